//! The tree builder of a driver, with a thread pool of its own.

use crate::builder_thread::{BuildFailed, Job};
use crate::options::PipelineError;
use crate::sampling::Sample;
use crate::tree_builder::{Built, Forms, Made, TreeBuilder};
use bvh_build::{BuildError, Cancel};
use bvh_layout::Spare;
use geom::{Animation, Point, Pose};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Builds the first tree, those of `rebuild` and those of the builder thread.
pub(crate) struct BuilderPool {
    pool: rayon::ThreadPool,
    builder: Mutex<TreeBuilder>,
}

impl BuilderPool {
    /// A pool of `threads`, at least one; `forms` as in [`TreeBuilder::with_forms`].
    pub(crate) fn new(threads: usize, forms: Forms) -> Result<Self, PipelineError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("abvh-build-{i}"))
            .build()
            .map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self {
            pool,
            builder: Mutex::new(TreeBuilder::with_forms(forms)),
        })
    }

    /// See [`TreeBuilder::build`], and with halves of its use [`TreeBuilder::build_swept`]. The caller waits.
    pub(crate) fn build(
        &self,
        animation: &Animation,
        (positions, halves): (&[Point], Option<[Pose; 2]>),
        (toward, spare): (Option<Point>, Spare),
    ) -> Result<Built, BuildFailed> {
        self.work(|builder| {
            builder.order_toward(toward);
            builder.reuse(spare);
            match halves {
                Some(halves) => builder.build_swept(animation, (positions, halves), &Cancel::new()),
                None => builder.build(animation, positions, &Cancel::new()),
            }
        })
    }

    /// See [`TreeBuilder::build_for_all`]. The caller waits.
    pub(crate) fn build_for_all(
        &self,
        animation: &Animation,
        samples: &[Sample],
        (first, toward): (Pose, Option<Point>),
    ) -> Result<Built, BuildFailed> {
        self.work(|builder| {
            builder.order_toward(toward);
            builder.build_for_all(animation, samples, first, &Cancel::new())
        })
    }

    /// See [`TreeBuilder::warm_up`]. The caller waits.
    pub(crate) fn warm_up(&self, animation: &Animation, pose: Pose) -> Result<(), BuildFailed> {
        self.work(|builder| builder.warm_up(animation, pose, &Cancel::new()))
    }

    /// See [`TreeBuilder::rebuild`]. The caller waits.
    pub(crate) fn do_job(
        &self,
        animation: &Animation,
        job: Job,
        cancel: &Cancel,
    ) -> Result<Made, BuildFailed> {
        let Job {
            vertices,
            halves,
            rival_at,
            toward,
            spare,
            left_last,
            ..
        } = job;
        self.work(|builder| {
            builder.order_toward(toward);
            builder.reuse(spare);
            if left_last {
                builder.revert();
            }
            builder.rebuild(animation, (vertices, halves), rival_at, cancel)
        })
    }

    fn work<T: Send>(
        &self,
        build: impl FnOnce(&mut TreeBuilder) -> Result<T, BuildError> + Send,
    ) -> Result<T, BuildFailed> {
        self.pool
            .install(|| build(&mut self.builder()))
            .map_err(|e| BuildFailed {
                reason: e.to_string(),
            })
    }

    /// Whatever a panic left of the builder is written over by the next build.
    fn builder(&self) -> MutexGuard<'_, TreeBuilder> {
        self.builder.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
