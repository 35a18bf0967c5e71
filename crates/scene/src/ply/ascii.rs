//! The body of an ascii file: a stream of numbers. Writers put each element on a line of its own, but no reader relies on it.

use super::element::{Element, push_number};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{ElementDef, PropertyType};
use std::borrow::Cow;

/// The unread part of a file.
pub(super) struct Body<'a> {
    pub(super) rest: &'a [u8],
    /// The current line, from 1.
    line: usize,
    /// The line in which the last element ends.
    last_line: usize,
    /// The first element that is not a whole line.
    unaligned: Option<String>,
    /// The current element in the parser's grammar.
    text: String,
}

/// The line that is wrong, and the reason.
type Wrong = (usize, String);

impl<'a> Body<'a> {
    pub(super) fn new(rest: &'a [u8], line: usize) -> Self {
        Self {
            rest,
            line,
            last_line: 0,
            unaligned: None,
            text: String::new(),
        }
    }

    pub(super) fn element(&mut self, of: &ElementDef, index: usize) -> Result<Element, Wrong> {
        self.text.clear();
        let mut first_line = None;
        for property in of.properties.values() {
            let word = self.word(of, index)?;
            first_line.get_or_insert(self.line);
            push_number(&mut self.text, &word);
            if matches!(property.data_type, PropertyType::List(..)) {
                let length = word.parse::<usize>().map_err(|_| {
                    let cause = format!("{word:?} is not the length of a list");
                    self.bad(of, index, &cause)
                })?;
                for _ in 0..length {
                    let word = self.word(of, index)?;
                    push_number(&mut self.text, &word);
                }
            }
        }
        let is_line = first_line == Some(self.line) && self.last_line < self.line;
        if !is_line && self.unaligned.is_none() {
            let (name, line) = (&of.name, first_line.unwrap_or(self.line));
            self.unaligned = Some(format!("'{name}' {index} in line {line}"));
        }
        self.last_line = self.line;
        let read = Parser::new().read_ascii_element(&self.text, of);
        read.map_err(|_| self.bad(of, index, &cause(&self.text)))
    }

    /// Skips the blanks at the end. If an element is not a whole line, no number may follow, because a number that is missing
    /// or in excess moves all later ones.
    pub(super) fn check_end(&mut self) -> Result<(), Wrong> {
        self.skip_blanks();
        match self.unaligned.is_some() && !self.rest.is_empty() {
            true => Err((self.line, self.hinted("numbers after the last element"))),
            false => Ok(()),
        }
    }

    fn word(&mut self, of: &ElementDef, index: usize) -> Result<Cow<'a, str>, Wrong> {
        self.skip_blanks();
        if self.rest.is_empty() {
            let (name, count) = (&of.name, of.count);
            let cause =
                format!("the file is cut short: {count} '{name}' are declared, {index} are there");
            return Err((self.line, self.hinted(&cause)));
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace);
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        Ok(String::from_utf8_lossy(word))
    }

    fn skip_blanks(&mut self) {
        while let Some((blank, rest)) = self.rest.split_first()
            && blank.is_ascii_whitespace()
        {
            let is_end = *blank == b'\n' || *blank == b'\r' && !rest.starts_with(b"\n");
            self.line += usize::from(is_end);
            self.rest = rest;
        }
    }

    fn bad(&self, of: &ElementDef, index: usize, cause: &str) -> Wrong {
        let cause = format!("bad '{}' {index}: {cause}", of.name);
        (self.line, self.hinted(&cause))
    }

    /// Appends the element from which on numbers may be read as others than were meant.
    fn hinted(&self, cause: &str) -> String {
        let hint = |first: &String| format!("{cause}; {first} is not on a line of its own");
        let hinted = self.unaligned.as_ref().map(hint);
        hinted.unwrap_or_else(|| cause.to_owned())
    }
}

fn cause(text: &str) -> String {
    let mut words = text.split_ascii_whitespace();
    match words.find(|word| word.parse::<f64>().is_err()) {
        Some(word) => format!("{word:?} is not a number"),
        None => format!("{:?} is not what the header declares", text.trim()),
    }
}
