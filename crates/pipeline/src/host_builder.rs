//! A driver's builder on the host: the memory that builds share, and the thread that runs them while frames are
//! rendered.

use crate::builder_thread::{BuildResult, BuilderThread, BuilderThreads};
use crate::tree_builder::{BuildInput, Built, TreeBuilder};
use backend::TreeFormat;
use bvh_build::Cancel;
use bvh_layout::Topology;
use geom::{Animation, Pose, lock};
use std::sync::{Arc, Mutex};

/// Builds the trees of one driver.
pub(crate) struct HostBuilder {
    animation: Arc<Animation>,
    threads: BuilderThreads,
    /// Locked by another thread only while a build is in flight.
    builder: Arc<Mutex<TreeBuilder>>,
    pub(crate) thread: BuilderThread,
}

impl HostBuilder {
    /// Creates a builder that runs on `threads`. Does not start its own thread.
    pub(crate) fn new(
        animation: &Arc<Animation>,
        threads: BuilderThreads,
        format: TreeFormat,
    ) -> Self {
        let builder = Arc::new(Mutex::new(TreeBuilder::with_format(format)));
        let thread = {
            let (animation, builder) = (Arc::clone(animation), Arc::clone(&builder));
            let threads = threads.clone();
            BuilderThread::new(move |input, cancel| {
                threads.build(&builder, |builder| builder.build(&animation, input, cancel))
            })
        };
        Self {
            animation: Arc::clone(animation),
            threads,
            builder,
            thread,
        }
    }

    /// Builds a tree while the caller waits.
    pub(crate) fn build_now(&self, input: BuildInput) -> BuildResult<Built> {
        let animation = &self.animation;
        self.threads.build(&self.builder, |builder| {
            builder.build(animation, input, &Cancel::new())
        })
    }

    /// Takes the memory of an adopted topology, except for parts that the backend shares. No build may be in flight.
    pub(crate) fn recycle(&self, adopted: Topology) {
        lock(&self.builder).reuse(adopted.into_spare());
    }

    /// Takes the memory of the last topology, which was never used. No build may be in flight.
    pub(crate) fn discard(&self, rejected: Topology) {
        let mut builder = lock(&self.builder);
        builder.reuse(rejected.into_spare());
        builder.revert();
    }

    /// Allocates the memory of later builds by building trees that are dropped. See `TreeBuilder::warm_up`. No job may
    /// be running.
    pub(crate) fn warm_up(&self, pose: Pose) {
        let animation = &self.animation;
        let warmed = |builder: &mut TreeBuilder| builder.warm_up(animation, pose, &Cancel::new());
        // The trees are dropped, so an error does not matter. The next build reports it again.
        let _ = self.threads.build(&self.builder, warmed);
    }
}
