//! Why a command ends early, and its exit code.

use backend::BackendError;
use output::OutputError;
use pipeline::PipelineError;
use scene::SceneError;
use std::fmt::{self, Display};
use std::process::ExitCode;

/// Reason why a command ended early.
#[derive(Clone, Debug)]
pub(crate) enum CliError {
    /// The request is invalid: exit code 2.
    InvalidRequest(String),
    /// The command ran and failed: exit code 1.
    Failed(String),
    /// A signal ended the command: exit code 128 plus its number.
    Signal(u8),
    /// Help or version was printed: exit code 0.
    HelpShown,
}

impl CliError {
    pub(crate) fn invalid(message: impl Display) -> Self {
        Self::InvalidRequest(unwrapped(&message.to_string()))
    }

    pub(crate) fn failed(message: impl Display) -> Self {
        Self::Failed(unwrapped(&message.to_string()))
    }

    pub(crate) fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::HelpShown => 0,
            Self::Failed(_) => 1,
            Self::InvalidRequest(_) => 2,
            Self::Signal(signal) => 128 + signal,
        })
    }
}

/// Combines the errors of a command whose parts all failed. Returns [`CliError::InvalidRequest`] only if every part is.
pub(crate) fn all_failed(parts: Vec<CliError>) -> CliError {
    let (mut reasons, mut is_invalid) = (Vec::new(), true);
    for part in parts {
        match part {
            CliError::InvalidRequest(why) => reasons.push(why),
            CliError::Failed(why) => {
                is_invalid = false;
                reasons.push(why);
            }
            end @ (CliError::Signal(_) | CliError::HelpShown) => return end,
        }
    }
    reasons.dedup();
    let why = reasons.join("; ");
    if is_invalid {
        CliError::InvalidRequest(why)
    } else {
        CliError::Failed(why)
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HelpShown | Self::Signal(_) => Ok(()),
            Self::InvalidRequest(text) | Self::Failed(text) => f.write_str(text),
        }
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
        let refused = all_failed(vec![bad.clone(), bad.clone()]);
        assert!(matches!(&refused, CliError::InvalidRequest(why) if why == "no device"));
        let broken = all_failed(vec![bad, failed]);
        assert!(matches!(&broken, CliError::Failed(why) if why == "no device; lost"));
    }

    #[test]
    fn maps_errors_to_exit_codes() {
        let unsupported = BackendError::Unsupported {
            backend: "cpu",
            what: "x".to_owned(),
        };
        assert!(matches!(
            CliError::from(unsupported),
            CliError::InvalidRequest(_)
        ));
        let threads = PipelineError::Threads("none".to_owned());
        assert!(matches!(
            CliError::from(threads),
            CliError::InvalidRequest(_)
        ));
        let lost = PipelineError::Backend(BackendError::DeviceLost("gone".to_owned()));
        assert!(matches!(CliError::from(lost), CliError::Failed(_)));
    }
}
