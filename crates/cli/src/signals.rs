//! SIGINT and SIGTERM: the program ends with 130 or 143, and leaves whole files only.

use crate::stop::Stop;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

struct Signals {
    /// The signal that came, 0 if none did.
    came: Arc<AtomicUsize>,
    /// Whether the next one ends the program at once.
    ends: Arc<AtomicBool>,
}

static SIGNALS: LazyLock<Signals> = LazyLock::new(|| Signals {
    came: Arc::new(AtomicUsize::new(0)),
    ends: Arc::new(AtomicBool::new(true)),
});

/// From here on, a signal ends the program with its exit code. Where handlers cannot be set, the system's own stay.
pub(crate) fn heed() {
    for signal in [SIGINT, SIGTERM] {
        let code = 128 + signal;
        let _ = flag::register_conditional_shutdown(signal, code, Arc::clone(&SIGNALS.ends));
        // A second one does not wait for what is asked to end.
        let _ = flag::register(signal, Arc::clone(&SIGNALS.ends));
        let _ = flag::register_usize(signal, Arc::clone(&SIGNALS.came), signal as usize);
    }
}

/// From here on, the first signal waits for [`check`].
pub(crate) fn wait_for_checks() {
    SIGNALS.ends.store(false, Ordering::Relaxed);
}

/// # Errors
/// [`Stop::Signal`] if a signal came.
pub(crate) fn check() -> Result<(), Stop> {
    match SIGNALS.came.load(Ordering::Relaxed) {
        0 => Ok(()),
        signal => Err(Stop::Signal(signal as u8)),
    }
}
