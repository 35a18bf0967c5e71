//! How cores are shared between rendering and building.

use backend::DeviceKind;
use pipeline::Update;
use rayon::ThreadBuilder;
use std::io;
use std::num::NonZero;
use std::sync::mpsc::{Sender, channel};

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
    let crew = crew(wanted, |work| {
        std::thread::Builder::new().spawn(work).map(drop)
    });
    if crew.len() < wanted {
        let fewer = crew.len().max(1);
        crate::talk::say(&format!(
            "the system starts no {wanted} threads: reading and shading take {fewer}"
        ));
    }
    // It fails only if the pool runs already; then it stays as it is.
    let pool = rayon::ThreadPoolBuilder::new();
    let _ = match &crew[..] {
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

/// Up to `wanted` threads that wait for work to do; they end if they get none. Where the system refuses one, half of those
/// that it granted are left to others.
fn crew(
    wanted: usize,
    spawn: impl Fn(Box<dyn FnOnce() + Send>) -> io::Result<()>,
) -> Vec<Sender<ThreadBuilder>> {
    let start = |_| {
        let (worker, inbox) = channel::<ThreadBuilder>();
        let work = move || inbox.recv().map(ThreadBuilder::run).unwrap_or_default();
        spawn(Box::new(work)).ok().map(|()| worker)
    };
    let mut crew: Vec<_> = (0..wanted).map_while(start).collect();
    if crew.len() < wanted {
        crew.truncate(crew.len() / 2);
    }
    crew
}

/// Shares `cores` out. With `async` both work at once: where the host renders, a quarter builds
/// on four cores or more; where a GPU does, all but the one that feeds it. With
/// the other policies one waits for the other, so both have all.
pub(crate) fn share(
    cores: usize,
    kind: DeviceKind,
    update: Update,
    [render, build]: [Option<usize>; 2],
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
    fn where_the_system_starts_too_few_threads_there_are_fewer() {
        let left = std::cell::Cell::new(5);
        let five = |work: Box<dyn FnOnce() + Send>| {
            let granted = left.replace(left.get() - 1);
            match granted > 0 {
                true => std::thread::Builder::new().spawn(work).map(drop),
                false => Err(io::ErrorKind::WouldBlock.into()),
            }
        };
        assert_eq!(crew(16, five).len(), 2);
        assert!(crew(4, |_| Err(io::ErrorKind::WouldBlock.into())).is_empty());
    }

    #[test]
    fn cores_are_shared_where_builder_and_renderer_work_at_once() {
        use DeviceKind::{Cpu, Gpu, Software};
        let (free, refit) = (Update::Async(Pace::Free), Update::Refit);
        // Cores, what was asked for, and threads that render and that build.
        for (kind, update, cores, asked, expected) in [
            (Cpu, free, 16, [None, None], [12, 4]),
            (Software, free, 16, [None, None], [12, 4]),
            (Cpu, free, 4, [None, None], [3, 1]),
            (Cpu, free, 2, [None, None], [2, 1]),
            (Cpu, free, 16, [Some(1), None], [1, 1]),
            (Software, free, 16, [Some(8), None], [8, 2]),
            (Gpu, free, 16, [None, None], [16, 15]),
            (Gpu, free, 1, [None, None], [1, 1]),
            (Gpu, free, 16, [Some(1), None], [1, 1]),
            (Gpu, free, 16, [None, Some(3)], [16, 3]),
            // Who waits lends all.
            (Cpu, refit, 8, [None, None], [8, 8]),
            (Gpu, refit, 8, [Some(2), Some(5)], [2, 5]),
        ] {
            let t = share(cores, kind, update, asked);
            assert_eq!([t.render, t.build], expected, "{kind:?} {cores} {asked:?}");
        }
    }
}
