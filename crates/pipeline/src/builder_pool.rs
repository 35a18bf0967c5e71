//! The tree builder of a driver, with a thread pool of its own.

use crate::builder_thread::BuildFailed;
use crate::driver::PipelineError;
use crate::tree_builder::{Forms, TreeBuilder};
use bvh_build::BuildError;
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

    /// Has the builder work in the pool's threads, while the caller waits.
    pub(crate) fn with<T: Send>(
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
