//! Rebuild on the host while the device refits and traces.
//!
//! The asynchronous scheme of Ize, Wald, Parker (*Asynchronous BVH Construction for Ray Tracing Dynamic Scenes*, 2007) as
//! Kim, Kim, Lee, Han (2014) split it between a device and its host. A schedule decides and knows no thread and no clock; a
//! builder works on a thread of its own. [`Driver`] owns the backend, carries out what the schedule says and never waits
//! for the builder, unless [`Policy::Lockstep`](backend::Policy::Lockstep) asks for it. Each [`FrameRecord`] says when what was done;
//! [`place_on_host`] says where the device's share of it lies.

mod builder_thread;
mod device_clock;
mod driver;
mod frame;
mod latency;
mod motion;
mod policy;
mod resources;
mod schedule;
mod tree_builder;

pub use builder_thread::BuilderThreads;
pub use device_clock::{Span, place_on_host};
pub use driver::{
    Answers, Driver, DriverOptions, LOOK_AHEAD, PipelineError, Wanted, Warmed, warm_up,
};
pub use frame::{Adopted, Frame, FrameMoments, FrameRecord, Submission, TreeMoments};
pub use motion::{Decay, Motion, RefitDecay, Spread, decay, motion, unhittable};
pub use policy::RunFacts;
pub use resources::{ExpectedMemory, TREE_BYTES, Threads, trees_bytes};
pub use tree_builder::BuildMoments;
