//! The only room that writes to the terminal: results to standard output, talk to standard error.

use crate::stop::Stop;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;

/// A result. A reader that went away has read enough.
pub(crate) fn print(text: &str) -> Result<(), Stop> {
    let mut out = io::stdout().lock();
    let text = plain(text, &['\n']);
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Stop::failed(format!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Stop> {
    let text = serde_json::to_string_pretty(value).map_err(Stop::failed)?;
    print(&format!("{text}\n"))
}

/// How wide the terminal of results is: what `COLUMNS` says, else what it says itself; `None` of no terminal.
pub(crate) fn columns() -> Option<usize> {
    if !io::stdout().is_terminal() {
        return None;
    }
    let said = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    let own = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| width.0.into());
    said.or_else(own).filter(|&columns| columns > 0)
}

/// A remark. Whoever closed standard error wants none.
pub(crate) fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{}", plain(text, &['\n']));
}

/// Says in one line why a command ended early; gives the exit code.
pub(crate) fn complain(stop: &Stop) -> ExitCode {
    let text = stop.to_string();
    if !text.is_empty() {
        say(&format!("abvh: {}", plain(&text, &[])));
    }
    stop.code()
}

/// Characters without a shape that change how others are shown: order of writing, joins, line ends, tags.
fn is_unseen(c: char) -> bool {
    matches!(
        c,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}'
    )
}

/// The text with its control characters, but those of `but`, and what cannot be seen spelt out: names and values are
/// anybody's, and a terminal obeys what it is sent.
pub(crate) fn plain<'a>(text: &'a str, but: &[char]) -> Cow<'a, str> {
    let is_command = |c: char| (c.is_control() || is_unseen(c)) && !but.contains(&c);
    if !text.contains(is_command) {
        return Cow::Borrowed(text);
    }
    let spell = |mut spelt: String, c: char| {
        match is_command(c) {
            true => spelt.extend(c.escape_default()),
            false => spelt.push(c),
        }
        spelt
    };
    Cow::Owned(text.chars().fold(String::new(), spell))
}

/// Progress of long work: a bar on a terminal, plain lines otherwise, or nothing.
pub(crate) struct Progress {
    /// Hidden but on a terminal.
    bar: ProgressBar,
    quiet: bool,
}

impl Progress {
    pub(crate) fn new(total: u64, quiet: bool) -> Self {
        let is_dumb = std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        let target = match quiet || is_dumb {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr(),
        };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        // On a narrow terminal the message gives way, not the counts.
        let template = "{bar:16} {pos}/{len} {eta} left  {wide_msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, quiet }
    }

    /// There are more steps than was known.
    pub(crate) fn lengthen(&mut self, by: u64) {
        self.bar.inc_length(by);
    }

    /// One step is done; `line` says which.
    pub(crate) fn step(&mut self, line: &str) {
        self.bar.set_message(plain(line, &[]).into_owned());
        self.bar.inc(1);
        if !self.quiet && self.bar.is_hidden() {
            let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
            say(&format!("{done}/{total}  {line}"));
        }
    }

    /// Counts steps that turned out to be unnecessary.
    pub(crate) fn skip(&mut self, steps: u64) {
        self.bar.inc(steps);
    }

    /// A remark among the steps.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| say(text));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_spelt_out_and_all_else_stays() {
        let name = "a  b\u{1b}[31m\r\n\u{9b}\0é.obj";
        assert_eq!(plain(name, &[]), "a  b\\u{1b}[31m\\r\\n\\u{9b}\\u{0}é.obj");
        assert_eq!(plain("one\ntwo", &['\n']), "one\ntwo");
        assert!(matches!(plain("a  é", &[]), Cow::Borrowed(_)));
    }

    #[test]
    fn what_turns_or_hides_text_is_spelt_out() {
        let name = "a\u{202e}jbo\u{200b}.\u{2028}\u{feff}x\u{2066}";
        let spelt = "a\\u{202e}jbo\\u{200b}.\\u{2028}\\u{feff}x\\u{2066}";
        assert_eq!(plain(name, &['\n']), spelt);
        assert!(matches!(plain("مرحبا שלום", &[]), Cow::Borrowed(_)));
    }
}
