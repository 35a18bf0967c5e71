//! The only room that writes to the terminal: results to standard output, talk to standard error.

use crate::stop::Stop;
use std::io::{self, Write};

/// A result. A reader that went away has read enough.
pub(crate) fn print(text: &str) -> Result<(), Stop> {
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Stop::failed(format!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

/// A result as indented JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Stop> {
    let text = serde_json::to_string_pretty(value).map_err(Stop::failed)?;
    print(&format!("{text}\n"))
}

/// A remark. Whoever closed standard error wants none.
pub(crate) fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// The one line that says why a command ended early.
pub(crate) fn complain(text: &str) {
    say(&format!("abvh: {text}"));
}
