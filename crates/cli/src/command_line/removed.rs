//! Options and values that earlier versions had, with their replacements.

use super::context;
use clap::error::ContextKind;
use std::fmt;

/// An option that is gone, or one of its values, and the option to use instead.
pub(super) struct Removed {
    option: &'static str,
    /// The value that is gone; `None` if the option is.
    value: Option<&'static str>,
    replacement: &'static str,
}

const REMOVED: [Removed; 4] = [
    Removed {
        option: "--update",
        value: Some("t-sah"),
        replacement: "--update refit",
    },
    Removed {
        option: "--intersector",
        value: Some("auto"),
        replacement: "--intersector watertight (the default) or --intersector exact",
    },
    Removed {
        option: "--tolerance",
        value: None,
        replacement: "--intersector watertight (the default) or --intersector exact",
    },
    Removed {
        option: "--law",
        value: None,
        replacement: "--property",
    },
];

impl fmt::Display for Removed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            option,
            value,
            replacement,
        } = self;
        let value = value.map_or(String::new(), |value| format!(" {value}"));
        write!(f, "{option}{value} was removed: use {replacement}")
    }
}

/// Returns the removed option or value that clap refuses, if it is one.
pub(super) fn find(e: &clap::Error) -> Option<&'static Removed> {
    // clap appends the placeholder of the value: `--update <POLICY>`.
    let option = context(e, ContextKind::InvalidArg)?
        .split([' ', '='])
        .next();
    let value = context(e, ContextKind::InvalidValue);
    let is_refused =
        |r: &&Removed| option == Some(r.option) && (r.value.is_none() || value == r.value);
    REMOVED.iter().find(is_refused)
}
