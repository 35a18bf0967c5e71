//! The interface that every command implements.

use crate::error::CliError;

/// A command with its settings.
pub(crate) trait RunCommand {
    /// Runs the command.
    fn run(&self) -> Result<(), CliError>;

    /// Returns the conditions under which options have an effect. If the user gives an option whose condition is not
    /// met, the command fails before it runs.
    fn requirements(&self) -> Vec<Requirement> {
        Vec::new()
    }

    /// Returns the requested number of threads of rayon's global pool. `None` means one per core.
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
    /// Rest of the error message, which begins with the option's name.
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
