//! Options and values that earlier versions had, with their replacements.

use super::context;
use clap::error::ContextKind;
use std::fmt;

/// A removed option, or a removed value of an option, with its replacement.
pub(super) struct Removed {
    option: &'static str,
    /// The removed value, or `None` if the whole option was removed.
    value: Option<&'static str>,
    replacement: &'static str,
}

const REMOVED: [Removed; 6] = [
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
        option: "--layout",
        value: None,
        replacement: "--backend cpu-ref for the binary tree; other backends have one layout each",
    },
    Removed {
        option: "--law",
        value: None,
        replacement: "--property",
    },
    Removed {
        option: "--oracle-rays",
        value: None,
        replacement: "--property continued_rays_visit_every_crossing_once --cases N",
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

/// Returns the entry for the option or value that clap refused, if it is in the list.
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
