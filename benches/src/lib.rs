//! What the benchmarks share: meshes, rays, and other crates behind one trait.
//!
//! `cargo bench -p benches --bench build` (or `convert`, `refit`, `trace`).
//! Every group names a mesh and its triangles; every function in it does the
//! same work on the same triangles or rays, so times compare within a group.
//! `--features embree` adds Embree 3 to the traces (Debian's `libembree-dev`), and the bench `duel`, which sets
//! this program against it sample by sample; `tinybvh` joins there.
//! Real meshes join in when `ABVH_MESHES` names a folder of them (see [`meshes`]).

mod mesh;
mod ours;
mod rays;
mod rival;
mod rivals;
mod rounds;
mod settings;
mod table;

pub use mesh::{Mesh, folder_or_demos, meshes};
pub use ours::{Ours, Tracer, built};
pub use rays::{camera, light, random_rays, shadow_rays};
pub use rival::{Node, Rival, sah_cost};
#[cfg(feature = "tinybvh")]
pub use rivals::TinyBvh;
pub use rivals::{Bvh, Obvhs, Parry};
#[cfg(feature = "embree")]
pub use rivals::{Embree, EmbreeScene, Packet16};
pub use rounds::{Contender, Samples, in_turn, least, median};
pub use settings::{criterion, pool, thread_counts};
pub use table::print_table;
