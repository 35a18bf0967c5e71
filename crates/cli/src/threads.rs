//! How cores are shared between rendering and building.

use backend::DeviceKind;
use pipeline::Update;
use rayon::ThreadBuilder;
use std::io;
use std::num::NonZero;
use std::sync::mpsc::{Sender, channel};

/// Threads that render, and threads that build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Threads {
    /// For the backend and for shading.
    pub(crate) render: usize,
    /// For trees.
    pub(crate) build: usize,
}

/// Logical cores this process may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Starts the threads of all work outside the backend (reading, shading): as many as there are cores,
/// or as were asked for. Where the system refuses, there are fewer, and a remark says so.
///
/// rayon's global pool can be tried only once, so the threads wait for it.
pub(crate) fn start(threads: Option<usize>) {
    let wanted = threads.unwrap_or_else(cores);
    let spawn = |work: Box<dyn FnOnce() + Send>| std::thread::Builder::new().spawn(work).map(drop);
    let (crew, remark) = crew(wanted, spawn);
    if let Some(remark) = remark {
        crate::talk::say(&remark);
    }
    // It fails only if the pool runs already; then it stays as it is.
    let pool = rayon::ThreadPoolBuilder::new();
    let _ = match crew.as_slice() {
        [] => pool.num_threads(1).use_current_thread().build_global(),
        crew => pool
            .num_threads(crew.len())
            .spawn_handler(|worker| hand(crew, worker))
            .build_global(),
    };
}

/// Has one of the crew do a worker's work.
fn hand(crew: &[Sender<ThreadBuilder>], worker: ThreadBuilder) -> io::Result<()> {
    let handed = crew[worker.index()].send(worker);
    handed.map_err(|_| io::ErrorKind::BrokenPipe.into())
}

/// How a thread is started.
type Spawn = fn(Box<dyn FnOnce() + Send>) -> io::Result<()>;

/// Up to `wanted` threads that wait for work to do; they end if they get none. Where the system refuses one, half of those
/// that it granted are left to others, and a remark says so.
fn crew(wanted: usize, spawn: Spawn) -> (Vec<Sender<ThreadBuilder>>, Option<String>) {
    let start = |_| {
        let (worker, inbox) = channel::<ThreadBuilder>();
        let work = move || inbox.recv().map(ThreadBuilder::run).unwrap_or_default();
        spawn(Box::new(work)).ok().map(|()| worker)
    };
    let mut crew: Vec<_> = (0..wanted).map_while(start).collect();
    if crew.len() == wanted {
        return (crew, None);
    }
    crew.truncate(crew.len() / 2);
    let remark = format!(
        "the system starts no {wanted} threads: reading and shading take {}",
        crew.len().max(1)
    );
    (crew, Some(remark))
}

/// Shares `cores` out. With `async` both work at once: where the host renders, a quarter builds
/// on four cores or more; where a GPU does, all but the one that feeds it. With
/// the other policies one waits for the other, so both have all.
pub(crate) fn share(
    cores: usize,
    kind: DeviceKind,
    update: Update,
    render: Option<usize>,
    build: Option<usize>,
) -> Threads {
    let quarter = |n: usize| (n / 4).max(1);
    let concurrent = matches!(update, Update::Async(_));
    let n = render.unwrap_or(cores);
    let (render, default) = match (concurrent, kind, render) {
        (false, ..) => (n, n),
        (true, DeviceKind::Gpu, _) => (n, (n - 1).max(1)),
        (true, _, None) if cores >= 4 => (cores - quarter(cores), quarter(cores)),
        (true, _, None) => (n, 1),
        (true, _, Some(n)) => (n, quarter(n)),
    };
    Threads {
        render,
        build: build.unwrap_or(default),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::Pace;

    #[test]
    fn threads_wait_for_work_and_end_without_it() {
        let spawn =
            |work: Box<dyn FnOnce() + Send>| std::thread::Builder::new().spawn(work).map(drop);
        let (crew, remark) = crew(3, spawn);
        assert_eq!((crew.len(), remark), (3, None));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
        let pool = pool
            .spawn_handler(|worker| hand(&crew, worker))
            .build()
            .unwrap();
        assert_eq!(pool.install(rayon::current_num_threads), 2);
    }

    #[test]
    fn where_the_system_starts_too_few_threads_there_are_fewer_with_a_remark() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        static GRANTED: AtomicUsize = AtomicUsize::new(0);
        let five = |work: Box<dyn FnOnce() + Send>| {
            if GRANTED.fetch_add(1, Ordering::Relaxed) >= 5 {
                return Err(io::ErrorKind::WouldBlock.into());
            }
            std::thread::Builder::new().spawn(work).map(drop)
        };
        let (some, remark) = crew(16, five);
        assert_eq!(some.len(), 2);
        assert!(remark.unwrap().contains("no 16 threads"));
        let (none, remark) = crew(4, |_| Err(io::ErrorKind::WouldBlock.into()));
        assert!(none.is_empty());
        assert!(remark.unwrap().contains("take 1"));
    }

    const FREE: Update = Update::Async(Pace::Free);

    fn shared(kind: DeviceKind, cores: usize, render: Option<usize>) -> (usize, usize) {
        let t = share(cores, kind, FREE, render, None);
        (t.render, t.build)
    }

    #[test]
    fn async_leaves_a_quarter_to_the_builder_where_there_are_four() {
        for kind in [DeviceKind::Cpu, DeviceKind::Software] {
            let shared = |cores, render| shared(kind, cores, render);
            assert_eq!(shared(16, None), (12, 4));
            assert_eq!(shared(4, None), (3, 1));
            assert_eq!(shared(2, None), (2, 1));
            assert_eq!(shared(16, Some(1)), (1, 1));
            assert_eq!(shared(16, Some(8)), (8, 2));
        }
    }

    #[test]
    fn beside_a_gpu_all_cores_but_one_build() {
        let shared = |cores, render| shared(DeviceKind::Gpu, cores, render);
        assert_eq!(shared(16, None), (16, 15));
        assert_eq!(shared(1, None), (1, 1));
        assert_eq!(shared(16, Some(1)), (1, 1));
        assert_eq!(share(16, DeviceKind::Gpu, FREE, None, Some(3)).build, 3);
    }

    #[test]
    fn who_waits_lends_all_and_what_is_asked_for_is_given() {
        for kind in [DeviceKind::Cpu, DeviceKind::Gpu] {
            let t = share(8, kind, Update::Rebuild, None, None);
            assert_eq!((t.render, t.build), (8, 8));
            let t = share(8, kind, Update::Refit, Some(2), Some(5));
            assert_eq!((t.render, t.build), (2, 5));
        }
    }
}
