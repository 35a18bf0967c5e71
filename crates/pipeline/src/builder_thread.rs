//! A pool of threads that build trees, and a thread that runs one job at a time in the pool while frames are rendered.

use crate::error::PipelineError;
use crate::tree_builder::{BuildInput, Built, TreeBuilder};
use bvh_build::{BuildError, Cancel};
use geom::{lock, run_in, start_library_pool};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// Result of a build, or the reason for its failure.
pub(crate) type BuildResult<T> = Result<T, String>;

/// A builder thread, which starts with the first job. Dropping it cancels the current build.
pub(crate) struct BuilderThread {
    /// Function that the thread runs; `None` once it is started.
    work: Option<Box<dyn FnOnce() + Send>>,
    thread: Option<JoinHandle<()>>,
    /// `None` once it is dropped.
    jobs: Option<SyncSender<BuildInput>>,
    trees: Receiver<BuildResult<Built>>,
    cancel: Arc<Cancel>,
}

impl BuilderThread {
    /// Creates a builder that runs `build` for each job. Does not start the thread.
    pub(crate) fn new(
        mut build: impl FnMut(BuildInput, &Cancel) -> BuildResult<Built> + Send + 'static,
    ) -> Self {
        let cancel = Arc::<Cancel>::default();
        let builder_cancel = Arc::clone(&cancel);
        let (jobs, inbox) = sync_channel(1);
        let (outbox, trees) = sync_channel(1);
        let work = move || {
            while let Ok(job) = inbox.recv() {
                let built = catch_unwind(AssertUnwindSafe(|| build(job, &builder_cancel)));
                let result = built.unwrap_or_else(|_| Err("the builder panicked".into()));
                if outbox.send(result).is_err() {
                    return;
                }
            }
        };
        Self {
            work: Some(Box::new(work)),
            thread: None,
            jobs: Some(jobs),
            trees,
            cancel,
        }
    }

    /// Returns whether the thread was started.
    #[cfg(test)]
    pub(crate) fn is_started(&self) -> bool {
        self.thread.is_some()
    }

    /// Submits a job. Fails if the thread cannot be started or has ended. Never blocks: the caller submits one job at a
    /// time.
    pub(crate) fn start(&mut self, job: BuildInput) -> BuildResult<()> {
        if let Some(work) = self.work.take() {
            let thread = std::thread::Builder::new().name("abvh-builder".into());
            let started = thread.spawn(work);
            self.thread = Some(started.map_err(|e| format!("cannot start builder thread: {e}"))?);
        }
        let jobs = self.jobs.as_ref().ok_or_else(gone)?;
        match jobs.try_send(job) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => panic!("one build is in flight at most"),
            Err(TrySendError::Disconnected(_)) => Err(gone()),
        }
    }

    /// Returns a finished result, if there is one. Never blocks.
    pub(crate) fn try_take(&mut self) -> Option<BuildResult<Built>> {
        self.trees.try_recv().ok()
    }

    /// Waits for the result of the submitted job.
    pub(crate) fn take(&mut self) -> BuildResult<Built> {
        self.trees.recv().unwrap_or_else(|_| Err(gone()))
    }
}

impl Drop for BuilderThread {
    fn drop(&mut self) {
        self.cancel.cancel();
        // The thread ends when the channel closes. It catches panics of builds, so `join` has nothing to report.
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn gone() -> String {
    "the builder thread has ended".into()
}

/// Threads that build trees, for any number of drivers.
#[derive(Clone, Debug)]
pub struct BuilderThreads(Arc<rayon::ThreadPool>);

impl BuilderThreads {
    /// Starts `threads` threads, or one if 0.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn new(threads: usize) -> Result<Self, PipelineError> {
        let builder = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|i| format!("abvh-build-{i}"));
        let pool =
            start_library_pool(builder).map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self(Arc::new(pool)))
    }

    /// Runs other work on these threads. Blocks the calling thread, unless it belongs to the pool.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        run_in(&self.0, work)
    }

    /// Runs `build` on these threads and waits for it.
    pub(crate) fn build<T: Send>(
        &self,
        builder: &Mutex<TreeBuilder>,
        build: impl FnOnce(&mut TreeBuilder) -> Result<T, BuildError> + Send,
    ) -> BuildResult<T> {
        // The next build overwrites the state that a panic left.
        let built = self.install(|| build(&mut lock(builder)));
        built.map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_builder::Vertices;

    fn job(is_compared: bool) -> BuildInput {
        BuildInput {
            is_compared,
            ..BuildInput::of(Vertices::ReadBack(Box::new(vec![[0.0; 3]])))
        }
    }

    #[test]
    fn build_panic_fails_only_one_job() {
        let mut thread = BuilderThread::new(|job: BuildInput, _: &Cancel| {
            assert!(job.is_compared, "planted");
            Err("planted".into())
        });
        assert!(!thread.is_started() && thread.try_take().is_none());
        for (is_compared, why) in [(false, "the builder panicked"), (true, "planted")] {
            thread.start(job(is_compared)).unwrap();
            assert_eq!(thread.take().unwrap_err(), why);
        }
    }

    #[test]
    fn builders_share_one_thread_pool() {
        let threads = BuilderThreads::new(2).unwrap();
        let thread_ids = || rayon::broadcast(|_| std::thread::current().id());
        let [one, other] = [(); 2].map(|()| Mutex::default());
        // A build can wait for another build on the same threads.
        let both = threads.build(&one, |_| Ok(threads.build(&other, |_| Ok(thread_ids()))));
        assert_eq!(both, Ok(Ok(threads.install(thread_ids))));
    }

    #[test]
    fn dropping_the_thread_cancels_the_build() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut thread = BuilderThread::new(move |_: BuildInput, cancel: &Cancel| {
            while !cancel.is_cancelled() {
                std::thread::yield_now();
            }
            sender.send(()).unwrap();
            Err("cancelled".into())
        });
        thread.start(job(false)).unwrap();
        drop(thread);
        receiver
            .try_recv()
            .expect("the build saw the cancel before the drop returned");
    }
}
