//! SIGINT and SIGTERM: the program ends with 130 or 143, and leaves whole files only.

use crate::stop::Stop;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

/// The signal that came, 0 if none did.
static CAME: AtomicI32 = AtomicI32::new(0);

/// Whether the next one ends the program at once.
static ENDS: AtomicBool = AtomicBool::new(true);

/// From here on, a signal ends the program with its exit code. Where nobody can listen, the system's own handlers stay, and
/// files that are half written stay until a later run finds them.
pub(crate) fn heed() {
    let _ = listen();
}

/// Has a thread of its own wait for signals, since a handler may do next to nothing.
#[cfg(unix)]
fn listen() -> io::Result<()> {
    let (sender, receiver) = std::sync::mpsc::channel();
    // The thread comes first: handlers that nobody answers would swallow signals.
    std::thread::Builder::new().spawn(move || {
        if let Ok(signals) = receiver.recv() {
            answer(signals);
        }
    })?;
    let signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    sender.send(signals).map_err(io::Error::other)
}

#[cfg(unix)]
fn answer(mut signals: signal_hook::iterator::Signals) {
    for signal in signals.forever() {
        // A second one does not wait for what is asked to end.
        if ENDS.swap(true, Ordering::Relaxed) {
            let _held = output::remove_unfinished();
            signal_hook::low_level::exit(128 + signal);
        }
        CAME.store(signal, Ordering::Relaxed);
    }
}

#[cfg(not(unix))]
fn listen() -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// From here on, the first signal waits for [`check`].
pub(crate) fn wait_for_checks() {
    ENDS.store(false, Ordering::Relaxed);
}

/// # Errors
/// [`Stop::Signal`] if a signal came.
pub(crate) fn check() -> Result<(), Stop> {
    match CAME.load(Ordering::Relaxed) {
        0 => Ok(()),
        signal => Err(Stop::Signal(signal as u8)),
    }
}
