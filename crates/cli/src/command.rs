//! The interface that every command implements.

use crate::stop::Stop;

/// A command with its settings.
pub(crate) trait RunCommand {
    /// Runs the command.
    fn run(&self) -> Result<(), Stop>;

    /// Returns what options require of others. A given option whose requirement is not met is refused before the run.
    fn requirements(&self) -> Vec<Requirement> {
        Vec::new()
    }

    /// Returns the requested number of threads for work outside the backend and the builder.
    fn threads(&self) -> Option<usize> {
        None
    }
}

/// An option that has an effect only under a condition.
pub(crate) struct Requirement {
    /// The option's name, with `_` for `-`.
    pub(crate) option: &'static str,
    /// Whether the option has an effect.
    pub(crate) is_met: bool,
    /// The message after the name of the option.
    pub(crate) text: &'static str,
}

impl Requirement {
    pub(crate) fn new(option: &'static str, is_met: bool, text: &'static str) -> Self {
        Self {
            option,
            is_met,
            text,
        }
    }
}
