//! Options and values that earlier versions had, with advice on what to use instead.

use super::context;
use clap::error::ContextKind;
use std::fmt;

/// A removed option, or a removed value of an option, with advice.
pub(super) struct Removed {
    /// The option. If the name of a command precedes it, the entry applies only to that command.
    option: &'static str,
    /// The removed value, or `None` if the whole option was removed.
    value: Option<&'static str>,
    /// What to do instead.
    advice: &'static str,
}

const fn option(option: &'static str, advice: &'static str) -> Removed {
    Removed {
        option,
        value: None,
        advice,
    }
}

const REMOVED: [Removed; 14] = [
    Removed {
        option: "--update",
        value: Some("t-sah"),
        advice: "use --update refit",
    },
    Removed {
        option: "--intersector",
        value: Some("auto"),
        advice: "use --intersector watertight (the default) or --intersector exact",
    },
    option(
        "--tolerance",
        "use --intersector watertight (the default) or --intersector exact",
    ),
    option(
        "--layout",
        "use --backend cpu-ref for the binary tree; other backends have one layout each",
    ),
    option("--law", "use --property"),
    option(
        "--oracle-rays",
        "use --property continued_rays_visit_every_crossing_once --cases N",
    ),
    option("--leak-rays", "use abvh stability, which counts leaks"),
    option("conform --intersector", "use abvh stability"),
    option(
        "--timeline",
        "use --stats, which has the times of every frame",
    ),
    option("bench --compare", "compare the files of --json or --csv"),
    option("bench --against", "compare the files of --json or --csv"),
    option("bench --fail-above", "compare the files of --json or --csv"),
    option("--reduce-keys", "there is no replacement"),
    option("--reduced-out", "there is no replacement"),
];

impl fmt::Display for Removed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            option,
            value,
            advice,
        } = self;
        let value = value.map_or(String::new(), |value| format!(" {value}"));
        write!(f, "{option}{value} was removed: {advice}")
    }
}

/// Returns the entry for the option or value that clap refused, if it is in the list. `command` is the name of the
/// command that the user gave.
pub(super) fn find(command: &str, e: &clap::Error) -> Option<&'static Removed> {
    // clap appends the placeholder of the value: `--update <POLICY>`.
    let named = context(e, ContextKind::InvalidArg)?;
    let option = named.split([' ', '=']).next()?;
    let of_command = format!("{command} {option}");
    let value = context(e, ContextKind::InvalidValue);
    let is_refused = |r: &&Removed| {
        [option, of_command.as_str()].contains(&r.option) && (r.value.is_none() || value == r.value)
    };
    REMOVED.iter().find(is_refused)
}
