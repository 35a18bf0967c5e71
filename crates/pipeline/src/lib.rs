//! Rebuild on the host while the device refits and traces.
//!
//! The asynchronous scheme of Ize, Wald, Parker (*Asynchronous BVH
//! Construction for Ray Tracing Dynamic Scenes*, 2007) as Kim, Kim, Lee, Han
//! (2014) split it between a device and its host. [`Schedule`] decides and
//! knows no thread and no clock; [`Workshop`] builds on a thread of its own;
//! [`Driver`] owns the backend, carries out what the schedule says and never
//! waits for the workshop, unless [`Pace::Lockstep`] asks for it.

mod driver;
mod frame;
mod schedule;
mod workbench;
mod workshop;

pub use driver::{Driver, Options, PipelineError};
pub use frame::{Adopted, Frame, FrameRecord};
pub use schedule::{Pace, Plan, Schedule, Swap, Update};
pub use workbench::{Built, Workbench};
pub use workshop::{BuildFailed, Job, Workshop};
