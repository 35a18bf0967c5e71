//! Why a command ends early, and its exit code.

use backend::BackendError;
use output::OutputError;
use pipeline::PipelineError;
use scene::SceneError;
use std::fmt::{self, Display};

/// Exit code of a command that ran and failed.
pub(crate) const FAILED: u8 = 1;
/// Exit code of an invalid request.
pub(crate) const INVALID: u8 = 2;

/// Reason why a command ended early.
#[derive(Clone, Debug)]
pub(crate) struct CliError {
    /// Exit code: [`FAILED`], [`INVALID`], or the code of [`CliError::silent`].
    pub(crate) code: u8,
    message: String,
}

impl CliError {
    pub(crate) fn invalid(message: impl Display) -> Self {
        let message = unwrapped(&message.to_string());
        let code = INVALID;
        Self { code, message }
    }

    pub(crate) fn failed(message: impl Display) -> Self {
        let message = unwrapped(&message.to_string());
        let code = FAILED;
        Self { code, message }
    }

    /// Returns an error without a message. The code is 0 after help or the version, and 128 plus the number of a
    /// signal after a signal.
    pub(crate) fn silent(code: u8) -> Self {
        let message = String::new();
        Self { code, message }
    }
}

/// Combines the errors of a command whose parts all failed. The exit code is [`INVALID`] only if that of every part is.
pub(crate) fn all_failed(parts: &[CliError]) -> CliError {
    let mut reasons: Vec<_> = parts.iter().map(ToString::to_string).collect();
    reasons.dedup();
    let why = reasons.join("; ");
    if parts.iter().all(|part| part.code == INVALID) {
        CliError::invalid(why)
    } else {
        CliError::failed(why)
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Joins the indented continuation lines of a parser's message into one line. Keeps other line breaks, such as those in
/// names.
fn unwrapped(text: &str) -> String {
    let mut lines = text.trim_end().split("\n  ");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |all, next| all + " " + next.trim_start())
}

/// A scene that cannot be read is invalid input.
impl From<SceneError> for CliError {
    fn from(e: SceneError) -> Self {
        Self::invalid(e)
    }
}

/// A file that cannot be written during the run is a failure. Errors of reading, and of checks before the run, are
/// [`CliError::invalid`] instead.
impl From<OutputError> for CliError {
    fn from(e: OutputError) -> Self {
        Self::failed(e)
    }
}

/// A request that no device here supports is bad usage. An error during execution is a failure.
impl From<BackendError> for CliError {
    fn from(e: BackendError) -> Self {
        match e {
            BackendError::NoDevice(_)
            | BackendError::Unsupported { .. }
            | BackendError::Limit { .. } => Self::invalid(e),
            _ => Self::failed(e),
        }
    }
}

impl From<abvh::Error> for CliError {
    fn from(e: abvh::Error) -> Self {
        match e {
            abvh::Error::NoDevice(_) | abvh::Error::Unsupported(_) | abvh::Error::Mesh(_) => {
                Self::invalid(e)
            }
            _ => Self::failed(e),
        }
    }
}

impl From<PipelineError> for CliError {
    fn from(e: PipelineError) -> Self {
        match e {
            PipelineError::Backend(e) => e.into(),
            PipelineError::Threads(_) => Self::invalid(e),
            e => Self::failed(e),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_is_one_line() {
        let error = CliError::failed("cannot write a:\n  disk full");
        assert_eq!(error.to_string(), "cannot write a: disk full");
        let error = CliError::invalid("'a  b\n.obj' is no file");
        assert_eq!(error.to_string(), "'a  b\n.obj' is no file");
    }

    #[test]
    fn combined_error_is_invalid_only_if_every_part_is() {
        let (bad, failed) = (CliError::invalid("no device"), CliError::failed("lost"));
        let refused = all_failed(&[bad.clone(), bad.clone()]);
        assert_eq!((refused.code, &*refused.message), (INVALID, "no device"));
        let broken = all_failed(&[bad, failed]);
        assert_eq!((broken.code, &*broken.message), (FAILED, "no device; lost"));
    }

    #[test]
    fn maps_errors_to_exit_codes() {
        let unsupported = BackendError::Unsupported {
            backend: "cpu",
            what: "x".to_owned(),
        };
        assert_eq!(CliError::from(unsupported).code, INVALID);
        let threads = PipelineError::Threads("none".to_owned());
        assert_eq!(CliError::from(threads).code, INVALID);
        let lost = PipelineError::Backend(BackendError::DeviceLost("gone".to_owned()));
        assert_eq!(CliError::from(lost).code, FAILED);
    }
}
