//! Traces rays through triangle meshes that move and deform, on the host or on a GPU. Needs no ray-tracing hardware.
//!
//! ```
//! use abvh::{Mesh, Query, Ray, Scene, Source, Tracer};
//!
//! let floor = [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]];
//! let cloth = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 1.0, 1.0]];
//! let mut scene = Scene::new();
//! scene.add(Mesh::fixed(&floor, &[[0, 1, 2]])?);
//! let sheet = scene.add(Mesh::streamed(&cloth, &[[0, 1, 2]])?);
//! let mut tracer = Tracer::builder().build(scene)?;
//!
//! let down = [Ray::new([0.0, 5.0, 0.0], [0.0, -1.0, 0.0])];
//! let mut step = tracer.step(0.0);
//! step.vertices(sheet, Source::Host(&cloth.map(|p| [p[0], 2.0, p[2]])))?;
//! let depth = step.trace(&down, Query::Closest)?;
//! let done = step.submit()?;
//! let hits = tracer.hits(done, depth)?;
//! let hit = hits.closest(0).expect("the sheet is in the way");
//! assert_eq!((hit.mesh, hit.t), (sheet, 3.0));
//! # Ok::<_, abvh::Error>(())
//! ```
//!
//! A [`Scene`] holds meshes, and a [`Tracer`] owns it on a [`Device`]. Time advances in [`Step`]s: a step moves meshes,
//! traces any number of queries, and is submitted. The device refits one tree to each step's vertices while host
//! threads build the next tree. No hit depends on a tree.
//!
//! The [`guide`] explains [concepts](guide::concepts), [streaming](guide::streaming), [devices](guide::devices) and
//! [accuracy](guide::accuracy), and maps the functions of [other libraries](guide::migration).

#[cfg(feature = "unstable")]
pub mod backends;
#[cfg(not(feature = "unstable"))]
mod backends;
mod builder;
mod device;
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
mod device_vertices;
mod disposal;
mod doctor;
mod error;
#[cfg(feature = "vulkan")]
pub mod external_memory;
#[cfg(feature = "vulkan")]
mod external_steps;
pub mod frames;
#[cfg(doc)]
pub mod guide;
mod hits;
mod joined;
mod loaded;
mod mesh;
mod motion;
#[cfg(feature = "wgpu")]
pub mod own_device;
mod pictures;
mod query;
mod replacement;
#[cfg(feature = "wgpu")]
pub mod shader_module;
mod shading;
mod state;
mod statistics;
mod step;
mod tracer;
#[cfg(feature = "wgpu")]
mod wgpu_steps;

pub use backend::{Intersector, Policy as Update, Rays};
pub use builder::TracerBuilder;
pub use device::Device;
pub use doctor::{Diagnosis, Problem, doctor};
pub use error::{Error, Result};
pub use geom::{Camera, CameraPose, Hit as SceneHit, Point, Ray};
pub use hits::{Hit, Hits};
pub use mesh::{Mesh, MeshId, Scene};
pub use motion::Matrix;
pub use query::{Query, QueryId, StepId};
pub use replacement::Replacement;
pub use statistics::Statistics;
pub use step::{Source, Step};
pub use tracer::Tracer;
