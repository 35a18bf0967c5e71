//! Writes to the terminal: results to standard output, remarks to standard error. All text passes through this
//! module, except the help and the version, which clap prints.

use crate::error::CliError;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;

/// Prints a result. A closed pipe is not an error.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    let text = plain(text, &['\n']);
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(CliError::failed(format!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).map_err(CliError::failed)?;
    print(&format!("{}\n", plain_json(&text)))
}

/// Returns the width of the terminal on standard output: `COLUMNS` if set, else the terminal's own value. Returns
/// `None` without a terminal.
pub(crate) fn columns() -> Option<usize> {
    if !io::stdout().is_terminal() {
        return None;
    }
    let requested = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    let own = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| width.0.into());
    requested.or_else(own).filter(|&columns| columns > 0)
}

/// Prints a remark to standard error, and ignores write errors.
pub(crate) fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", plain(text, &['\n']));
}

/// Prints in one line why a command ended early. Returns the exit code.
pub(crate) fn complain(error: &CliError) -> ExitCode {
    let text = error.to_string();
    if !text.is_empty() {
        say(&format!("abvh: {}", plain(&text, &[])));
    }
    ExitCode::from(error.code)
}

/// Returns whether a character is an invisible format character. Examples are soft hyphens, bidirectional controls,
/// joiners, line separators and tags.
fn is_unseen(c: char) -> bool {
    matches!(
        c,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
    )
}

/// Escapes control characters and invisible characters, except those in `kept`. Names and values can come from
/// untrusted sources, and terminals execute control sequences.
pub(crate) fn plain(text: &str, kept: &[char]) -> String {
    escaped(text, kept, |c| c.escape_default().to_string())
}

/// Escapes the same characters of JSON text as [`plain`], except line breaks. The escapes of [`plain`] are invalid in
/// JSON.
fn plain_json(json: &str) -> String {
    escaped(json, &['\n'], |c| {
        let mut units = [0; 2];
        let units = c.encode_utf16(&mut units).iter();
        units.map(|unit| format!("\\u{unit:04x}")).collect()
    })
}

/// Replaces characters that could control the terminal or are invisible, except those in `kept`.
fn escaped(text: &str, kept: &[char], escape: fn(char) -> String) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if (c.is_control() || is_unseen(c)) && !kept.contains(&c) {
            escaped += &escape(c);
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// Progress of long work: a bar on a terminal, plain lines otherwise, or nothing.
pub(crate) struct ProgressLine {
    /// Hidden if `quiet` is set, `TERM` is `dumb`, or standard error is no terminal.
    bar: ProgressBar,
    quiet: bool,
}

impl ProgressLine {
    pub(crate) fn new(total: u64, quiet: bool) -> Self {
        let is_dumb = std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        let target = if quiet || is_dumb {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        // On a narrow terminal the message is cut, not the counts.
        let template = "{bar:16} {pos}/{len} {eta} left  {wide_msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, quiet }
    }

    /// Advances by one step, which `line` describes.
    pub(crate) fn step(&mut self, line: &str) {
        self.bar.set_message(plain(line, &[]));
        self.bar.inc(1);
        if !self.quiet && self.bar.is_hidden() {
            let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
            say(&format!("{done}/{total}  {line}"));
        }
    }

    /// Prints a remark between steps.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| say(text));
        }
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_control_characters_but_not_letters() {
        let name = "a  b\u{1b}[31m\r\n\u{9b}\0é.obj";
        assert_eq!(plain(name, &[]), "a  b\\u{1b}[31m\\r\\n\\u{9b}\\u{0}é.obj");
        assert_eq!(plain("one\ntwo", &['\n']), "one\ntwo");
        assert_eq!(plain("a  é", &[]), "a  é");
    }

    #[test]
    fn escapes_bidi_and_invisible_characters() {
        let name = "a\u{202e}jbo\u{200b}.\u{2028}\u{feff}x\u{2066}";
        let spelt = "a\\u{202e}jbo\\u{200b}.\\u{2028}\\u{feff}x\\u{2066}";
        assert_eq!(plain(name, &['\n']), spelt);
        assert_eq!(plain("مرحبا שלום", &[]), "مرحبا שלום");
    }

    #[test]
    fn json_remains_valid() {
        let names = ["\u{200d}\u{ad}.obj", "\u{7f}\u{9b}\u{e0041}", "a\nb é\\"];
        let text = plain_json(&serde_json::to_string_pretty(&names).unwrap());
        assert_eq!(plain(&text, &['\n']), text);
        let read: Vec<String> = serde_json::from_str(&text).unwrap();
        assert_eq!(read, names);
    }
}
