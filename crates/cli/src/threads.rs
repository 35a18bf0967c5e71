//! Threads for all work outside the backend and the builder.

use rayon::ThreadBuilder;
use std::io;
use std::sync::mpsc::{Sender, channel};

/// Starts the threads for all work outside the backend (reading, shading): `threads`, or one per core. If the system
/// refuses some, there are fewer, and a remark reports it.
///
/// rayon's global pool can be built only once, so the threads are started before it.
pub(crate) fn start(threads: Option<usize>) {
    let wanted = threads.unwrap_or_else(host::cores);
    let crew = crew(wanted, |work| {
        std::thread::Builder::new().spawn(work).map(drop)
    });
    if crew.len() < wanted {
        let fewer = crew.len().max(1);
        crate::console::say(&format!(
            "the system starts no {wanted} threads: reading and shading take {fewer}"
        ));
    }
    // Building fails only if a pool exists already, which then remains.
    let pool = rayon::ThreadPoolBuilder::new();
    let _ = match &crew[..] {
        [] => pool.num_threads(1).use_current_thread().build_global(),
        crew => pool
            .num_threads(crew.len())
            .spawn_handler(|worker| hand(crew, worker))
            .build_global(),
    };
    geom::use_global_pool();
}

/// Runs a rayon worker on one of the started threads.
fn hand(crew: &[Sender<ThreadBuilder>], worker: ThreadBuilder) -> io::Result<()> {
    let handed = crew[worker.index()].send(worker);
    handed.map_err(|_| io::ErrorKind::BrokenPipe.into())
}

/// Starts up to `wanted` threads that wait for a worker, and end without one. If the system refuses a thread, half
/// of the started threads end again, so that other work can start threads.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_back_to_fewer_threads() {
        let left = std::cell::Cell::new(5);
        let five = |work: Box<dyn FnOnce() + Send>| {
            let granted = left.replace(left.get() - 1);
            if granted > 0 {
                std::thread::Builder::new().spawn(work).map(drop)
            } else {
                Err(io::ErrorKind::WouldBlock.into())
            }
        };
        assert_eq!(crew(16, five).len(), 2);
        assert!(crew(4, |_| Err(io::ErrorKind::WouldBlock.into())).is_empty());
    }
}
