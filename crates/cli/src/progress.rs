//! Progress of long work: a bar on a terminal, plain lines otherwise, or nothing.

use crate::talk;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

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
        self.bar.set_message(talk::plain(line, &[]).into_owned());
        self.bar.inc(1);
        if !self.quiet && self.bar.is_hidden() {
            let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
            talk::say(&format!("{done}/{total}  {line}"));
        }
    }

    /// A remark among the steps.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| talk::say(text));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
