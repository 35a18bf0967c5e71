//! On SIGINT and SIGTERM the program exits with 130 or 143, and leaves only complete files.

use crate::error::CliError;
use std::sync::atomic::{AtomicI32, Ordering};

/// The signal that arrived. Before that, the response to a signal: [`RUN_HANDLES_SIGNAL`] or [`EXITS_AT_ONCE`].
static ARRIVED: AtomicI32 = AtomicI32::new(EXITS_AT_ONCE);
/// [`check`] reports the first signal to the run.
const RUN_HANDLES_SIGNAL: i32 = 0;
/// The first signal ends the program, without waiting for the run.
const EXITS_AT_ONCE: i32 = -1;

/// Handles SIGINT and SIGTERM: removes incomplete files and exits with the signal's exit code. If no thread can be
/// started, their default handlers remain, and a later run removes incomplete files. Also ignores SIGXFSZ.
pub(crate) fn handle() {
    #[cfg(unix)]
    let _ = listen();
}

/// Starts a thread that waits for signals, since a signal handler may call few functions.
#[cfg(unix)]
fn listen() -> std::io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
    // With SIGXFSZ handled, writing a file beyond the size limit returns an error.
    signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default())?;
    let (sender, receiver) = std::sync::mpsc::channel();
    // The thread starts first, since handlers without a thread would swallow signals.
    std::thread::Builder::new().spawn(move || {
        if let Ok(signals) = receiver.recv() {
            wait_for_signals(signals);
        }
    })?;
    let signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    sender.send(signals).map_err(std::io::Error::other)
}

#[cfg(unix)]
fn wait_for_signals(mut signals: signal_hook::iterator::Signals) {
    for signal in signals.forever() {
        // A second signal, or any signal before [`defer`], ends the program at once.
        if ARRIVED.swap(signal, Ordering::Relaxed) != RUN_HANDLES_SIGNAL {
            end_at_once(signal);
        }
        let wait_and_end = move || {
            std::thread::sleep(GRACE_PERIOD);
            end_at_once(signal);
        };
        // If this thread cannot start, only a second signal ends a blocked run.
        let _ = std::thread::Builder::new().spawn(wait_and_end);
    }
}

/// Time in which a run must end after the first signal. A run that is blocked in a write cannot end by itself.
#[cfg(unix)]
const GRACE_PERIOD: std::time::Duration = std::time::Duration::from_secs(1);

#[cfg(unix)]
fn end_at_once(signal: i32) -> ! {
    // No temporary file can be created while this guard is held.
    let _held = output::remove_unfinished();
    signal_hook::low_level::exit(128 + signal)
}

/// From now on, the first signal is reported by [`check`]. It ends the program only if the run does not end in time.
pub(crate) fn defer() {
    ARRIVED.store(RUN_HANDLES_SIGNAL, Ordering::Relaxed);
}

/// Fails if a signal arrived. The error has the exit code of the signal.
pub(crate) fn check() -> Result<(), CliError> {
    match ARRIVED.load(Ordering::Relaxed) {
        RUN_HANDLES_SIGNAL | EXITS_AT_ONCE => Ok(()),
        signal => Err(CliError::silent(128 + signal as u8)),
    }
}
