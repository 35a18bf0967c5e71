//! A builder on a thread of its own, with a door that holds one job.

use crate::{Made, Vertices};
use backend::Generation;
use bvh_build::Cancel;
use bvh_layout::Spare;
use geom::{Point, Pose};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Vertices that wait to become a tree.
pub struct Job {
    /// Which tree it will be.
    pub generation: Generation,
    /// What it is built from.
    pub vertices: Vertices,
    /// Poses early and late in the time it will be used, if that is known.
    pub halves: Option<[Pose; 2]>,
    /// Where it must be cheaper than the tree in use; `None` if it is wanted in any case.
    pub rival_at: Option<Pose>,
    /// Where rays end that ask for any hit, if they end in one place.
    pub toward: Option<Point>,
    /// An old record's memory, or nothing.
    pub spare: Spare,
    /// Whether the last tree that was handed over was never used.
    pub left_last: bool,
}

/// A build that came to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BuildFailed {
    /// Why.
    pub reason: String,
}

/// How a job becomes a tree.
type BuildFunction = dyn FnMut(Job, &Cancel) -> Result<Made, BuildFailed> + Send;

type Delivery = (Generation, Result<Made, BuildFailed>);

/// One builder thread, started with the first job. Dropping it cancels what it is at.
pub struct BuilderThread {
    build: Option<Box<BuildFunction>>,
    open: Option<Open>,
    cancel: Arc<Cancel>,
}

struct Open {
    jobs: SyncSender<Job>,
    trees: Receiver<Delivery>,
    thread: JoinHandle<()>,
}

impl BuilderThread {
    /// A builder that knows its build; no thread yet.
    pub fn new(
        build: impl FnMut(Job, &Cancel) -> Result<Made, BuildFailed> + Send + 'static,
    ) -> Self {
        Self {
            build: Some(Box::new(build)),
            open: None,
            cancel: Arc::default(),
        }
    }

    /// Whether a thread was ever started.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Hands a job in. Never waits: the caller keeps to one job at a time.
    ///
    /// # Errors
    /// The builder thread cannot be started or is gone.
    ///
    /// # Panics
    /// If a second job is handed in before the first was taken up.
    pub fn start(&mut self, job: Job) -> Result<(), BuildFailed> {
        if let Some(build) = self.build.take() {
            self.open = Some(Open::new(build, Arc::clone(&self.cancel))?);
        }
        let open = self.open.as_ref().ok_or_else(gone)?;
        match open.jobs.try_send(job) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => panic!("one build is in flight at most"),
            Err(TrySendError::Disconnected(_)) => Err(gone()),
        }
    }

    /// A finished tree, if there is one. Never waits.
    pub fn try_take(&mut self) -> Option<Delivery> {
        self.open.as_ref()?.trees.try_recv().ok()
    }

    /// Waits for the job that was handed in.
    pub fn take(&mut self) -> Option<Delivery> {
        self.open.as_ref()?.trees.recv().ok()
    }
}

impl Drop for BuilderThread {
    fn drop(&mut self) {
        self.cancel.cancel();
        if let Some(Open {
            jobs,
            trees,
            thread,
        }) = self.open.take()
        {
            drop((jobs, trees));
            // The thread catches the build's panics; nothing is left to report.
            let _ = thread.join();
        }
    }
}

impl Open {
    fn new(mut build: Box<BuildFunction>, cancel: Arc<Cancel>) -> Result<Self, BuildFailed> {
        let (jobs, inbox) = sync_channel::<Job>(1);
        let (outbox, trees) = sync_channel(1);
        let work = move || {
            while let Ok(job) = inbox.recv() {
                let generation = job.generation;
                let result =
                    catch_unwind(AssertUnwindSafe(|| build(job, &cancel))).unwrap_or_else(|_| {
                        Err(BuildFailed {
                            reason: "the builder panicked".into(),
                        })
                    });
                if outbox.send((generation, result)).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new()
            .name("abvh-builder".into())
            .spawn(work)
            .map_err(|e| BuildFailed {
                reason: format!("no builder thread: {e}"),
            })?;
        Ok(Self {
            jobs,
            trees,
            thread,
        })
    }
}

fn gone() -> BuildFailed {
    BuildFailed {
        reason: "the builder thread is gone".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(n: u64) -> Job {
        Job {
            generation: Generation(n),
            vertices: Vertices::ReadBack(Box::new(vec![[0.0; 3]])),
            halves: None,
            rival_at: None,
            toward: None,
            spare: Spare::default(),
            left_last: false,
        }
    }

    #[test]
    fn a_panic_in_the_craft_is_a_failed_build_and_the_next_job_goes_on() {
        let mut w = BuilderThread::new(|job: Job, _: &Cancel| {
            assert!(job.generation.0 != 1, "planted");
            Err(BuildFailed {
                reason: "planted".into(),
            })
        });
        assert!(!w.is_open() && w.try_take().is_none());
        w.start(job(1)).unwrap();
        let (g, r) = w.take().unwrap();
        assert_eq!(
            (g.0, r.unwrap_err().reason.as_str()),
            (1, "the builder panicked")
        );
        w.start(job(2)).unwrap();
        assert_eq!(w.take().unwrap().1.unwrap_err().reason, "planted");
    }

    #[test]
    fn dropping_the_workshop_cancels_the_build() {
        let (said, hear) = std::sync::mpsc::channel();
        let mut w = BuilderThread::new(move |_: Job, cancel: &Cancel| {
            while !cancel.is_cancelled() {
                std::thread::yield_now();
            }
            said.send(()).unwrap();
            Err(BuildFailed {
                reason: "cancelled".into(),
            })
        });
        w.start(job(1)).unwrap();
        drop(w);
        hear.try_recv()
            .expect("the build saw the cancel before the drop returned");
    }
}
