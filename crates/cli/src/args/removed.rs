//! Options and values that earlier versions had, with their replacements.

use clap::error::{ContextKind, ContextValue};

/// An option that is gone, or one of its values, and what to use instead.
struct Removed {
    option: &'static str,
    /// The value that is gone; `None` if the option is.
    value: Option<&'static str>,
    replacement: &'static str,
}

const REMOVED: &[Removed] = &[Removed {
    option: "--update",
    value: Some("t-sah"),
    replacement: "removed, use --update refit, which renders as fast",
}];

/// Returns what replaces the option or the value that clap refuses, if an earlier version had it.
pub(super) fn replacement(e: &clap::Error) -> Option<&'static str> {
    let text = |kind| match e.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    // clap appends the name of the value: `--update <POLICY>`.
    let option = text(ContextKind::InvalidArg)?.split(' ').next();
    let value = text(ContextKind::InvalidValue);
    let is_refused =
        |r: &&Removed| option == Some(r.option) && (r.value.is_none() || value == r.value);
    REMOVED.iter().find(is_refused).map(|r| r.replacement)
}
