//! A driver's builder on the host: the memory that builds share, and the thread that runs them while frames are
//! rendered.

use crate::builder_thread::{BuildResult, BuilderPool, BuilderThread, BuilderThreads};
use crate::tree_builder::{BuildInput, Built, Job, TreeBuilder};
use backend::{TreeFormat, TreeWriter};
use bvh_build::Cancel;
use bvh_layout::{Spare, Topology};
use geom::{Animation, Point, Pose};
use std::sync::Arc;

/// Builds the trees of one driver.
pub(crate) struct HostBuilder {
    animation: Arc<Animation>,
    pool: Arc<BuilderPool>,
    pub(crate) thread: BuilderThread,
    /// Memory of a topology that is not used any more, for the next build.
    spare: Spare,
    /// Whether the thread's last tree was dropped unused. The next job reports this to the thread.
    discarded_last: bool,
}

impl HostBuilder {
    /// Creates a builder that runs on `threads`. Does not start its own thread.
    pub(crate) fn new(
        animation: &Arc<Animation>,
        threads: BuilderThreads,
        format: TreeFormat,
    ) -> Self {
        let pool = Arc::new(BuilderPool::new(threads, format));
        let thread = {
            let (pool, animation) = (Arc::clone(&pool), Arc::clone(animation));
            BuilderThread::new(move |job, cancel| {
                pool.with(|builder| builder.execute(&animation, job, cancel))
            })
        };
        Self {
            animation: Arc::clone(animation),
            pool,
            thread,
            spare: Spare::default(),
            discarded_last: false,
        }
    }

    /// Starts a build on the thread. Children of nodes are ordered for rays that end at `toward`, such as shadow rays.
    /// Fails if the thread cannot be started or has ended.
    pub(crate) fn start(
        &mut self,
        input: BuildInput,
        toward: Option<Point>,
        writer: Option<TreeWriter>,
    ) -> BuildResult<()> {
        self.thread.start(Job {
            input,
            toward,
            spare: std::mem::take(&mut self.spare),
            discarded_last: std::mem::take(&mut self.discarded_last),
            writer,
        })
    }

    /// Builds a tree from scratch while the caller waits.
    pub(crate) fn build_now(
        &mut self,
        input: BuildInput,
        toward: Option<Point>,
    ) -> BuildResult<Built> {
        let (animation, spare) = (&self.animation, std::mem::take(&mut self.spare));
        self.pool.with(|builder| {
            builder.order_toward(toward);
            builder.reuse(spare);
            builder.build(animation, input, &Cancel::new())
        })
    }

    /// Takes the memory of an adopted topology, which the backend has copied.
    pub(crate) fn recycle(&mut self, adopted: Topology) {
        self.spare = adopted.into_spare();
    }

    /// Takes the memory of the thread's last topology, which was never used.
    pub(crate) fn discard(&mut self, rejected: Topology) {
        self.spare = rejected.into_spare();
        self.discarded_last = true;
    }

    /// Allocates the memory of later builds by building trees that are dropped. See `TreeBuilder::warm_up`. No job may
    /// be running.
    pub(crate) fn warm_up(&self, pose: Pose) {
        let animation = &self.animation;
        let warmed = |builder: &mut TreeBuilder| builder.warm_up(animation, pose, &Cancel::new());
        // The trees are dropped, so an error does not matter. The next build reports it again.
        let _ = self.pool.with(warmed);
    }
}
