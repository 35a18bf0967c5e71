//! Progress of long work: a bar on a terminal, plain lines otherwise, or nothing.

use crate::talk;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, stderr};

/// Shows how far the work is.
pub(crate) enum Progress {
    /// On a terminal.
    Bar(ProgressBar),
    /// Into a file or a pipe.
    Lines {
        /// Steps done.
        done: u64,
        /// Steps in all.
        total: u64,
    },
    /// Asked to be quiet.
    Quiet,
}

impl Progress {
    /// For `total` steps.
    pub(crate) fn new(total: u64, quiet: bool) -> Self {
        if quiet {
            return Self::Quiet;
        }
        if !stderr().is_terminal() || std::env::var_os("TERM").is_some_and(|t| t == "dumb") {
            return Self::Lines { done: 0, total };
        }
        let bar = ProgressBar::new(total);
        // On a narrow terminal the message gives way, not the counts.
        let template = "{bar:16} {pos}/{len} {eta} left  {wide_msg}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self::Bar(bar)
    }

    /// There are more steps than was known.
    pub(crate) fn lengthen(&mut self, by: u64) {
        match self {
            Self::Bar(bar) => bar.inc_length(by),
            Self::Lines { total, .. } => *total += by,
            Self::Quiet => {}
        }
    }

    /// One step is done; `line` says which.
    pub(crate) fn step(&mut self, line: &str) {
        match self {
            Self::Bar(bar) => {
                bar.set_message(talk::plain(line, &[]).into_owned());
                bar.inc(1);
            }
            Self::Lines { done, total } => {
                *done += 1;
                talk::say(&format!("{done}/{total}  {line}"));
            }
            Self::Quiet => {}
        }
    }

    /// A remark among the steps.
    pub(crate) fn say(&self, text: &str) {
        match self {
            Self::Bar(bar) => bar.suspend(|| talk::say(text)),
            Self::Lines { .. } => talk::say(text),
            Self::Quiet => {}
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
