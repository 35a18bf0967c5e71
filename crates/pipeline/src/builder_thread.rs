//! The builder: a pool of threads, and a thread that runs one job at a time in the pool while frames are rendered.

use crate::error::PipelineError;
use crate::tree_builder::{Built, Job, TreeBuilder};
use backend::TreeFormat;
use bvh_build::{BuildError, Cancel};
use geom::{lock, own_pool, run_in};
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
    jobs: Option<SyncSender<Job>>,
    trees: Receiver<BuildResult<Built>>,
    cancel: Arc<Cancel>,
}

impl BuilderThread {
    /// Creates a builder that runs `build` for each job. Does not start the thread.
    pub(crate) fn new(
        mut build: impl FnMut(Job, &Cancel) -> BuildResult<Built> + Send + 'static,
    ) -> Self {
        let cancel = Arc::<Cancel>::default();
        let heard = Arc::clone(&cancel);
        let (jobs, inbox) = sync_channel(1);
        let (outbox, trees) = sync_channel(1);
        let work = move || {
            while let Ok(job) = inbox.recv() {
                let built = catch_unwind(AssertUnwindSafe(|| build(job, &heard)));
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

    /// Returns whether the thread was ever started.
    #[cfg(test)]
    pub(crate) fn is_open(&self) -> bool {
        self.thread.is_some()
    }

    /// Submits a job. Fails if the thread cannot be started or has ended. Never blocks: the caller submits one job at a
    /// time.
    pub(crate) fn start(&mut self, job: Job) -> BuildResult<()> {
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
        match self.thread {
            Some(_) => self.trees.recv().unwrap_or_else(|_| Err(gone())),
            None => Err(gone()),
        }
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
        let pool = own_pool(builder).map_err(|e| PipelineError::Threads(e.to_string()))?;
        Ok(Self(Arc::new(pool)))
    }

    /// Runs other work on these threads. Blocks the calling thread, unless it belongs to the pool.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        run_in(&self.0, work)
    }
}

/// Builds trees in a pool of threads, one at a time: first trees, trees of `rebuild`, and jobs of the builder thread.
pub(crate) struct BuilderPool {
    threads: BuilderThreads,
    builder: Mutex<TreeBuilder>,
}

impl BuilderPool {
    /// Creates a builder that runs on these threads and produces trees of this format.
    pub(crate) fn new(threads: BuilderThreads, format: TreeFormat) -> Self {
        Self {
            threads,
            builder: Mutex::new(TreeBuilder::with_format(format)),
        }
    }

    /// Runs `build` in the pool's threads and waits for it.
    pub(crate) fn with<T: Send>(
        &self,
        build: impl FnOnce(&mut TreeBuilder) -> Result<T, BuildError> + Send,
    ) -> BuildResult<T> {
        // The next build overwrites the state that a panic left.
        let builder = || lock(&self.builder);
        let built = self.threads.install(|| build(&mut builder()));
        built.map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_builder::{BuildInput, Vertices};
    use bvh_layout::Spare;

    fn job(discarded_last: bool) -> Job {
        Job {
            input: BuildInput::of(Vertices::ReadBack(Box::new(vec![[0.0; 3]]))),
            toward: None,
            spare: Spare::default(),
            discarded_last,
            writer: None,
        }
    }

    #[test]
    fn build_panic_fails_only_one_job() {
        let mut thread = BuilderThread::new(|job: Job, _: &Cancel| {
            assert!(job.discarded_last, "planted");
            Err("planted".into())
        });
        assert!(!thread.is_open() && thread.try_take().is_none());
        for (discarded_last, why) in [(false, "the builder panicked"), (true, "planted")] {
            thread.start(job(discarded_last)).unwrap();
            assert_eq!(thread.take().unwrap_err(), why);
        }
    }

    #[test]
    fn builders_share_one_thread_pool() {
        let threads = BuilderThreads::new(2).unwrap();
        let who = || rayon::broadcast(|_| std::thread::current().id());
        let builder = || BuilderPool::new(threads.clone(), TreeFormat::Binary);
        let (one, other) = (builder(), builder());
        let own = threads.install(who);
        assert_eq!(
            [&one, &other].map(|b| b.with(|_| Ok(who()))),
            [(); 2].map(|()| Ok(own.clone()))
        );
        // A build can wait for another build on the same threads.
        assert_eq!(one.with(|_| Ok(other.with(|_| Ok(who())))), Ok(Ok(own)));
    }

    #[test]
    fn dropping_the_thread_cancels_the_build() {
        let (said, hear) = std::sync::mpsc::channel();
        let mut thread = BuilderThread::new(move |_: Job, cancel: &Cancel| {
            while !cancel.is_cancelled() {
                std::thread::yield_now();
            }
            said.send(()).unwrap();
            Err("cancelled".into())
        });
        thread.start(job(false)).unwrap();
        drop(thread);
        hear.try_recv()
            .expect("the build saw the cancel before the drop returned");
    }
}
