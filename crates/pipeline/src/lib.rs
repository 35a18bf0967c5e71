//! Builds trees on the host while the device refits and traces.
//!
//! Implements the asynchronous scheme of Ize, Wald, Parker (*Asynchronous BVH Construction for Ray Tracing Dynamic
//! Scenes*, 2007), divided between a device and its host as by Kim, Kim, Lee, Han (2014). The builder
//! runs on its own thread. [`Driver`] owns the backend, and decides when to request and adopt trees.
//! `docs/design/driver.md` states for which trees a frame waits.

mod builder_thread;
mod driver;
mod error;
mod frame;
mod host_builder;
mod latency;
mod motion;
mod policy;
mod resources;
mod tree_builder;

pub use builder_thread::BuilderThreads;
pub use driver::{
    Driver, DriverOptions, FrameOutputs, LOOK_AHEAD, OutputSelection, WarmUp, Warmed,
};
pub use error::PipelineError;
pub use frame::{Frame, FrameRecord, FrameTreeStats};
pub use motion::{
    CountRange, MotionStats, RefitCosts, RefitDegradation, inactive_and_degenerate,
    inactive_and_degenerate_at, motion, refit_costs,
};
pub use policy::RunFacts;
pub use resources::{ExpectedMemory, HOST_BYTES_PER_TRIANGLE, Threads, trees_and_rays_bytes};
