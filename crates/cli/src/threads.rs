//! Rayon's global pool, which the program and the library share.

use rayon::ThreadBuilder;
use std::io;
use std::sync::mpsc::{Sender, channel};

/// Starts rayon's global pool for parallel work that has no pool of its own, such as reading, shading, writing and the
/// copies of GPU backends. Builders and CPU backends have their own pools. The global pool has `threads` threads, or
/// one per core. If the system cannot start that many, prints a remark and uses fewer.
///
/// The global pool can be built only once. So the threads are started first, and the pool uses those that started.
pub(crate) fn start(threads: Option<usize>) {
    let wanted = threads.unwrap_or_else(host::cores);
    let worker_senders = worker_senders(wanted, |work| {
        std::thread::Builder::new().spawn(work).map(drop)
    });
    if worker_senders.len() < wanted {
        let fewer = worker_senders.len().max(1);
        crate::console::say(&format!(
            "the system cannot start {wanted} threads: reading and shading use {fewer}"
        ));
    }
    // Building fails only if a pool exists already. Then that pool is used.
    let pool = rayon::ThreadPoolBuilder::new();
    let _ = match &worker_senders[..] {
        [] => pool.num_threads(1).use_current_thread().build_global(),
        worker_senders => pool
            .num_threads(worker_senders.len())
            .spawn_handler(|worker| send_worker(worker_senders, worker))
            .build_global(),
    };
    // This program owns the process, so `geom` uses rayon's global pool instead of its own.
    geom::use_global_pool();
}

/// Runs a rayon worker on one of the started threads.
fn send_worker(worker_senders: &[Sender<ThreadBuilder>], worker: ThreadBuilder) -> io::Result<()> {
    let handed = worker_senders[worker.index()].send(worker);
    handed.map_err(|_| io::ErrorKind::BrokenPipe.into())
}

/// Starts up to `wanted` threads. Each receives a rayon worker and runs it, or ends if its sender is dropped. If the
/// system refuses a thread, keeps only half of the threads, so that other code can start some.
fn worker_senders(
    wanted: usize,
    spawn: impl Fn(Box<dyn FnOnce() + Send>) -> io::Result<()>,
) -> Vec<Sender<ThreadBuilder>> {
    let start = |_| {
        let (sender, receiver) = channel::<ThreadBuilder>();
        let work = move || receiver.recv().map(ThreadBuilder::run).unwrap_or_default();
        spawn(Box::new(work)).ok().map(|()| sender)
    };
    let mut worker_senders: Vec<_> = (0..wanted).map_while(start).collect();
    if worker_senders.len() < wanted {
        worker_senders.truncate(worker_senders.len() / 2);
    }
    worker_senders
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
        assert_eq!(worker_senders(16, five).len(), 2);
        assert!(worker_senders(4, |_| Err(io::ErrorKind::WouldBlock.into())).is_empty());
    }
}
