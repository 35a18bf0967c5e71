//! Why a command ends early, and what the shell hears of it. With SIGINT and SIGTERM the program ends with 130 or 143, and
//! leaves whole files only.

use backend::BackendError;
use output::OutputError;
use pipeline::PipelineError;
use scene::SceneError;
use std::fmt::{self, Display};
use std::process::ExitCode;
use std::sync::atomic::{AtomicI32, Ordering};

/// The end of a command that did not do what was asked.
#[derive(Clone, Debug)]
pub(crate) enum Stop {
    /// It was asked for something that cannot be: exit code 2.
    Bad(String),
    /// It ran and failed: exit code 1.
    Failed(String),
    /// A signal asked it to end: exit code 128 and that.
    Signal(u8),
    /// Help or version was asked for and shown: exit code 0.
    Shown,
}

impl Stop {
    pub(crate) fn bad(message: impl Display) -> Self {
        Self::Bad(unwrapped(&message.to_string()))
    }

    pub(crate) fn failed(message: impl Display) -> Self {
        Self::Failed(unwrapped(&message.to_string()))
    }

    pub(crate) fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Shown => 0,
            Self::Failed(_) => 1,
            Self::Bad(_) => 2,
            Self::Signal(signal) => 128 + signal,
        })
    }
}

/// Returns the end of a command of which each part failed. It is bad usage only if each part was.
pub(crate) fn all_failed(parts: Vec<Stop>) -> Stop {
    let (mut reasons, mut is_bad) = (Vec::new(), true);
    for part in parts {
        match part {
            Stop::Bad(why) => reasons.push(why),
            Stop::Failed(why) => {
                is_bad = false;
                reasons.push(why);
            }
            end @ (Stop::Signal(_) | Stop::Shown) => return end,
        }
    }
    reasons.dedup();
    let why = reasons.join("; ");
    if is_bad {
        Stop::Bad(why)
    } else {
        Stop::Failed(why)
    }
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shown | Self::Signal(_) => Ok(()),
            Self::Bad(text) | Self::Failed(text) => f.write_str(text),
        }
    }
}

/// Lines that go on indented, as parsers wrap them, as one. Whatever else is in a text, such as a name, stays.
fn unwrapped(text: &str) -> String {
    let mut lines = text.trim_end().split("\n  ");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |all, next| all + " " + next.trim_start())
}

/// Whatever is wrong with a scene is wrong with the input.
impl From<SceneError> for Stop {
    fn from(e: SceneError) -> Self {
        Self::bad(e)
    }
}

/// A file that could not be written while running. Checks made before, and whoever reads, call [`Stop::bad`].
impl From<OutputError> for Stop {
    fn from(e: OutputError) -> Self {
        Self::failed(e)
    }
}

/// What no device here can do is bad usage; what one broke down over is a failure.
impl From<BackendError> for Stop {
    fn from(e: BackendError) -> Self {
        match e {
            BackendError::NoDevice(_)
            | BackendError::Unsupported { .. }
            | BackendError::Limit { .. } => Self::bad(e),
            _ => Self::failed(e),
        }
    }
}

impl From<abvh::Error> for Stop {
    fn from(e: abvh::Error) -> Self {
        match e {
            abvh::Error::NoDevice(_) | abvh::Error::Unsupported(_) | abvh::Error::Mesh(_) => {
                Self::bad(e)
            }
            _ => Self::failed(e),
        }
    }
}

impl From<PipelineError> for Stop {
    fn from(e: PipelineError) -> Self {
        match e {
            PipelineError::Backend(e) => e.into(),
            PipelineError::Threads(_) => Self::bad(e),
            e => Self::failed(e),
        }
    }
}

/// The signal that came; [`WAITS`] if none did, or [`ENDS`] where it is not waited for.
static CAME: AtomicI32 = AtomicI32::new(ENDS);
const WAITS: i32 = 0;
const ENDS: i32 = -1;

/// From here on, a signal ends the program with its exit code. Where nobody can listen, the system's own handlers stay, and
/// files that are half written stay until a later run finds them.
pub(crate) fn heed_signals() {
    #[cfg(unix)]
    let _ = listen();
}

/// Has a thread of its own wait for signals, since a handler may do next to nothing.
#[cfg(unix)]
fn listen() -> std::io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
    // Whoever writes too large a file hears of it from the system's call.
    signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default())?;
    let (sender, receiver) = std::sync::mpsc::channel();
    // The thread comes first: handlers that nobody answers would swallow signals.
    std::thread::Builder::new().spawn(move || {
        if let Ok(signals) = receiver.recv() {
            answer(signals);
        }
    })?;
    let signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    sender.send(signals).map_err(std::io::Error::other)
}

#[cfg(unix)]
fn answer(mut signals: signal_hook::iterator::Signals) {
    for signal in signals.forever() {
        // A second one does not wait for what is asked to end.
        if CAME.swap(signal, Ordering::Relaxed) != WAITS {
            end_at_once(signal);
        }
        let wait_and_end = move || {
            std::thread::sleep(PATIENCE);
            end_at_once(signal);
        };
        // Without it, only a second signal ends a run that is blocked.
        let _ = std::thread::Builder::new().spawn(wait_and_end);
    }
}

/// How long a run may take to see that a signal came. One that writes where nobody reads never does.
#[cfg(unix)]
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(1);

#[cfg(unix)]
fn end_at_once(signal: i32) -> ! {
    let _held = output::remove_unfinished();
    signal_hook::low_level::exit(128 + signal)
}

/// From here on, the first signal waits for [`check_signals`], for a while.
pub(crate) fn let_signals_wait() {
    CAME.store(WAITS, Ordering::Relaxed);
}

/// [`Stop::Signal`] if a signal came.
pub(crate) fn check_signals() -> Result<(), Stop> {
    match CAME.load(Ordering::Relaxed) {
        WAITS | ENDS => Ok(()),
        signal => Err(Stop::Signal(signal as u8)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line() {
        let stop = Stop::failed("cannot write a:\n  disk full");
        assert_eq!(stop.to_string(), "cannot write a: disk full");
        let stop = Stop::bad("'a  b\n.obj' is no file");
        assert_eq!(stop.to_string(), "'a  b\n.obj' is no file");
    }

    #[test]
    fn parts_that_all_fail_give_each_reason_once_and_the_worst_code() {
        let (bad, failed) = (Stop::bad("no device"), Stop::failed("lost"));
        let refused = all_failed(vec![bad.clone(), bad.clone()]);
        assert!(matches!(&refused, Stop::Bad(why) if why == "no device"));
        let broken = all_failed(vec![bad, failed]);
        assert!(matches!(&broken, Stop::Failed(why) if why == "no device; lost"));
    }

    #[test]
    fn what_no_device_can_do_is_bad_usage_and_a_lost_device_is_a_failure() {
        let unsupported = BackendError::Unsupported {
            backend: "cpu",
            what: "x".to_owned(),
        };
        assert!(matches!(Stop::from(unsupported), Stop::Bad(_)));
        let threads = PipelineError::Threads("none".to_owned());
        assert!(matches!(Stop::from(threads), Stop::Bad(_)));
        let lost = PipelineError::Backend(BackendError::DeviceLost("gone".to_owned()));
        assert!(matches!(Stop::from(lost), Stop::Failed(_)));
    }
}
