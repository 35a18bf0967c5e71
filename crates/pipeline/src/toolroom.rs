//! The one workbench of a driver, with a thread pool of its own.

use crate::options::PipelineError;
use crate::sampling::Sample;
use crate::workbench::{Built, Forms, Made, Workbench};
use crate::workshop::{BuildFailed, Job};
use bvh_build::{BuildError, Cancel};
use bvh_layout::Spare;
use geom::{Animation, Point, Pose};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The tools of the first build, of `rebuild` and of the workshop.
pub(crate) struct Toolroom {
    pool: rayon::ThreadPool,
    tools: Mutex<Workbench>,
}

impl Toolroom {
    /// A pool of `threads`, at least one; `forms` as in [`Workbench::with_forms`].
    pub(crate) fn new(threads: usize, forms: Forms) -> Result<Self, PipelineError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("abvh-build-{i}"))
            .build()
            .map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self {
            pool,
            tools: Mutex::new(Workbench::with_forms(forms)),
        })
    }

    /// See [`Workbench::build`], and with halves of its use [`Workbench::build_swept`]. The caller waits.
    pub(crate) fn build(
        &self,
        animation: &Animation,
        (positions, halves): (&[Point], Option<[Pose; 2]>),
        (toward, spare): (Option<Point>, Spare),
    ) -> Result<Built, BuildFailed> {
        self.work(|tools| {
            tools.face(toward);
            tools.reuse(spare);
            match halves {
                Some(halves) => tools.build_swept(animation, (positions, halves), &Cancel::new()),
                None => tools.build(animation, positions, &Cancel::new()),
            }
        })
    }

    /// See [`Workbench::build_for_all`]. The caller waits.
    pub(crate) fn build_for_all(
        &self,
        animation: &Animation,
        samples: &[Sample],
        (first, toward): (Pose, Option<Point>),
    ) -> Result<Built, BuildFailed> {
        self.work(|tools| {
            tools.face(toward);
            tools.build_for_all(animation, samples, first, &Cancel::new())
        })
    }

    /// See [`Workbench::practise`]. The caller waits.
    pub(crate) fn practise(&self, animation: &Animation, pose: Pose) -> Result<(), BuildFailed> {
        self.work(|tools| tools.practise(animation, pose, &Cancel::new()))
    }

    /// See [`Workbench::build_better`]. The caller waits.
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
        self.work(|tools| {
            tools.face(toward);
            tools.reuse(spare);
            if left_last {
                tools.take_back();
            }
            tools.build_better(animation, (vertices, halves), rival_at, cancel)
        })
    }

    fn work<T: Send>(
        &self,
        build: impl FnOnce(&mut Workbench) -> Result<T, BuildError> + Send,
    ) -> Result<T, BuildFailed> {
        self.pool
            .install(|| build(&mut self.tools()))
            .map_err(|e| BuildFailed {
                reason: e.to_string(),
            })
    }

    /// Whatever a panic left of the tools is written over by the next build.
    fn tools(&self) -> MutexGuard<'_, Workbench> {
        self.tools.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
