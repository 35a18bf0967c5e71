//! What the benchmarks share: meshes, rays, and other crates behind one trait.
//!
//! `cargo bench -p benches --bench build` (or `convert`, `refit`, `trace`).
//! Every group names a mesh and its triangles; every function in it does the
//! same work on the same triangles or rays, so times compare within a group.
//! `--features embree` adds Embree 3 to the traces (Debian's `libembree-dev`).
//! Real meshes join in when `ABVH_MESHES` names a folder of them (see [`meshes`]).

mod mesh;
mod ours;
mod rays;
mod rival;
mod rivals;
mod settings;
mod table;

pub use mesh::{Mesh, meshes};
pub use ours::{Ours, Tracer, built};
pub use rays::{camera, primary_rays, shadow_rays};
pub use rival::{Node, Rival, sah_cost};
#[cfg(feature = "embree")]
pub use rivals::Embree;
pub use rivals::{Bvh, Obvhs, Parry};
pub use settings::{criterion, pool, thread_counts};
pub use table::print_table;
