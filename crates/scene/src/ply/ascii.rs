//! Body of an ascii file: a stream of numbers. Writers usually put each element on its own line, but this is not
//! required.

use super::element::{Element, is_plain, push_number};
use crate::{Result, SceneError};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{ElementDef, PropertyType};
use std::borrow::Cow;
use std::path::Path;

/// Unread part of a file.
pub(super) struct AsciiBody<'a> {
    path: &'a Path,
    pub(super) rest: &'a [u8],
    /// Current line, counted from 1.
    line: usize,
    /// Line in which the previous element ends.
    last_line: usize,
    /// Description of the first element that does not occupy exactly one line.
    unaligned: Option<String>,
    /// Current element, converted to the parser's grammar.
    text: String,
}

impl<'a> AsciiBody<'a> {
    pub(super) fn new(path: &'a Path, rest: &'a [u8], line: usize) -> Self {
        Self {
            path,
            rest,
            line,
            last_line: 0,
            unaligned: None,
            text: String::new(),
        }
    }

    pub(super) fn element(&mut self, definition: &ElementDef, index: usize) -> Result<Element> {
        self.skip_blanks();
        if let Some(element) = self.whole_line(definition) {
            return Ok(element);
        }
        self.text.clear();
        let mut first_line = None;
        for property in definition.properties.values() {
            let word = self.word(definition, index)?;
            first_line.get_or_insert(self.line);
            push_number(&mut self.text, &word);
            if matches!(property.data_type, PropertyType::List(..)) {
                let length = word.parse::<usize>().map_err(|_| {
                    let cause = format!("{word:?} is not the length of a list");
                    self.bad(definition, index, &cause)
                })?;
                for _ in 0..length {
                    let word = self.word(definition, index)?;
                    push_number(&mut self.text, &word);
                }
            }
        }
        let is_line = first_line == Some(self.line) && self.last_line < self.line;
        if !is_line && self.unaligned.is_none() {
            let (name, line) = (&definition.name, first_line.unwrap_or(self.line));
            self.unaligned = Some(format!("'{name}' {index} in line {line}"));
        }
        self.last_line = self.line;
        parse(&self.text, definition).map_err(|cause| self.bad(definition, index, &cause))
    }

    /// Reads an element that occupies exactly one line, without copying its words. Returns `None` if the line does not
    /// match the element or the parser's grammar. Also returns `None` if the previous element ends in this line.
    fn whole_line(&mut self, definition: &ElementDef) -> Option<Element> {
        // Does not search a line for its end twice, since a line with many elements would take quadratic time.
        if self.last_line == self.line {
            return None;
        }
        let is_end = |b: &u8| matches!(b, b'\n' | b'\r');
        let end = self.rest.iter().position(is_end);
        let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        let line = str::from_utf8(line).ok()?;
        let words = || line.split_ascii_whitespace();
        let mut needed = 0_usize;
        for property in definition.properties.values() {
            if matches!(property.data_type, PropertyType::List(..)) {
                let length = words().nth(needed)?.parse().ok()?;
                needed = needed.checked_add(length)?;
            }
            needed = needed.checked_add(1)?;
        }
        if words().count() != needed || !words().all(is_plain) {
            return None;
        }
        let element = parse(line, definition).ok()?;
        self.rest = rest;
        self.last_line = self.line;
        Some(element)
    }

    /// Skips trailing blanks. If some element did not occupy exactly one line, checks that nothing follows. A number
    /// that is left over means that an earlier extra number has shifted the elements.
    pub(super) fn check_end(&mut self) -> Result<()> {
        self.skip_blanks();
        if self.unaligned.is_some() && !self.rest.is_empty() {
            return Err(self.error("numbers after the last element"));
        }
        Ok(())
    }

    fn word(&mut self, definition: &ElementDef, index: usize) -> Result<Cow<'a, str>> {
        self.skip_blanks();
        if self.rest.is_empty() {
            let (name, count) = (&definition.name, definition.count);
            let cause =
                format!("the file is cut short: {count} '{name}' are declared, {index} are there");
            return Err(self.error(&cause));
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

    fn bad(&self, definition: &ElementDef, index: usize, cause: &str) -> SceneError {
        self.error(&format!("bad '{}' {index}: {cause}", definition.name))
    }

    /// Returns an error in the current line. It also names the first element that does not occupy exactly one line,
    /// since numbers may have been misread from there on.
    fn error(&self, cause: &str) -> SceneError {
        let hint = |first: &String| format!("{cause}; {first} is not on a line of its own");
        let hinted = self.unaligned.as_ref().map(hint);
        let cause = hinted.unwrap_or_else(|| cause.to_owned());
        SceneError::malformed(self.path, ("line", self.line), cause)
    }
}

/// Parses an element. First checks that enough memory is free, because the parser allocates up to 24 bytes per byte of
/// text.
fn parse(text: &str, definition: &ElementDef) -> Result<Element, String> {
    host::check_memory(24 * text.len() as u64).map_err(|e| e.to_string())?;
    let read = Parser::new().read_ascii_element(text, definition);
    read.map_err(|_| cause(text))
}

fn cause(text: &str) -> String {
    let mut words = text.split_ascii_whitespace();
    match words.find(|word| word.parse::<f64>().is_err()) {
        Some(word) => format!("{word:?} is not a number"),
        None => format!("{:?} is not what the header declares", text.trim()),
    }
}
