//! The one workbench of a driver, with a thread pool of its own.

use crate::options::PipelineError;
use crate::workbench::{Built, Workbench};
use crate::workshop::BuildFailed;
use bvh_build::Cancel;
use geom::{Animation, Point};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The tools of the first build, of `rebuild` and of the workshop.
pub(crate) struct Toolroom {
    pool: rayon::ThreadPool,
    tools: Mutex<Workbench>,
}

impl Toolroom {
    /// A pool of `threads`, at least one.
    pub(crate) fn new(threads: usize) -> Result<Self, PipelineError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("abvh-build-{i}"))
            .build()
            .map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self {
            pool,
            tools: Mutex::default(),
        })
    }

    /// See [`Workbench::build`]. The caller waits.
    pub(crate) fn build(
        &self,
        animation: &Animation,
        positions: &[Point],
        cancel: &Cancel,
    ) -> Result<Built, BuildFailed> {
        self.pool
            .install(|| self.tools().build(animation, positions, cancel))
            .map_err(|e| BuildFailed {
                reason: e.to_string(),
            })
    }

    /// The tools hold no state between builds but memory, so a panic in one leaves nothing broken.
    fn tools(&self) -> MutexGuard<'_, Workbench> {
        self.tools.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
