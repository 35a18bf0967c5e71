//! Traces rays through triangle meshes that move and deform, on the host or on a GPU, which needs no ray-tracing hardware.
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
//! # Concepts
//!
//! A [`Scene`] holds meshes. A [`Tracer`] owns it on a [`Device`]. Time goes on in [`Step`]s: a step says where meshes are,
//! traces any number of queries, and is submitted. Results stay until the second step after theirs is submitted.
//!
//! - [`Mesh::fixed`] never moves; [`Mesh::keyframes`] blends key frames known beforehand, by the step's time.
//! - [`Mesh::streamed`] takes new vertices in any step, [`Mesh::rigid`] a matrix for each of its parts. Both stay where they
//!   are in steps that say nothing of them.
//!
//! # Trees
//!
//! The device refits one tree to each step's vertices while threads of the host build the next. So no step but the first
//! waits for a build, and no hit ever depends on a tree's age: see [`Update`].
//!
//! # Accuracy
//!
//! Hits are equal, bit for bit, on every device. [`Intersector::Watertight`] lets no ray through the edges of a closed mesh;
//! [`Intersector::Exact`] gives the answer of exact arithmetic. A vertex may be anywhere; a triangle with a vertex that is
//! not finite is inactive: it is never hit, and counted ([`Statistics::inactive`]).

mod device;
mod doctor;
mod error;
mod hits;
mod mesh;
mod motion;
mod step;
mod tracer;

pub use backend::{Intersector, Layout, Rays};
pub use device::Device;
pub use doctor::{Diagnosis, Problem, doctor};
pub use error::{Error, Result};
pub use geom::{Camera, Point, Ray};
pub use hits::{Hit, Hits};
pub use mesh::{Mesh, MeshId, Scene};
pub use motion::Matrix;
pub use step::{Query, QueryId, Source, Step, StepId};
pub use tracer::{Builder, Statistics, Tracer, Update};
