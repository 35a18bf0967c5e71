//! One vertex or face, filled by the parser as it goes; and the text of a file in the words that the parser knows.

use crate::Rgb;
use geom::Point;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::borrow::Cow;

/// What is used of an element of any kind.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) point: Point,
    pub(super) colour: Rgb,
    /// One bit for each of red, green and blue that is there.
    pub(super) colour_parts: u8,
    /// The vertices of a face; nothing if one of them is negative.
    pub(super) corners: Option<Vec<u32>>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "x" => self.set_coordinate(0, &property),
            "y" => self.set_coordinate(1, &property),
            "z" => self.set_coordinate(2, &property),
            "red" | "r" | "diffuse_red" => self.set_colour(0, &property),
            "green" | "g" | "diffuse_green" => self.set_colour(1, &property),
            "blue" | "b" | "diffuse_blue" => self.set_colour(2, &property),
            "vertex_indices" | "vertex_index" => {
                self.corners = property.to_u32_list();
                PropertyAccessResult::Set
            }
            _ => PropertyAccessResult::Ignored,
        }
    }
}

impl Element {
    fn set_coordinate(&mut self, axis: usize, property: &Property) -> PropertyAccessResult {
        match property.to_f32_lossy() {
            Some(x) => self.point[axis] = x,
            None => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }

    fn set_colour(&mut self, part: usize, property: &Property) -> PropertyAccessResult {
        match property.to_u8_color_lossy() {
            Some(c) => self.colour[part] = c,
            None => return PropertyAccessResult::Ignored,
        }
        self.colour_parts |= 1 << part;
        PropertyAccessResult::Set
    }
}

/// The header with its last line's end, or nothing if it has none.
pub(super) fn whole_header(bytes: &[u8]) -> Option<&[u8]> {
    let mut start = 0;
    while let Some(length) = bytes[start..].iter().position(|&b| b == b'\n') {
        let end = start + length + 1;
        if bytes[start..end].trim_ascii() == b"end_header" {
            return Some(&bytes[..end]);
        }
        start = end;
    }
    None
}

/// A line of numbers as the parser's grammar wants them.
///
/// It takes no `nan`, no `inf`, no `.5` and no `5.`, which other programs
/// write. Numbers that are none become ones too large to be finite: either
/// way the vertex is absent. What is no number at all is left to the parser to refuse.
pub(super) fn numbers(line: &[u8]) -> Cow<'_, str> {
    let line = String::from_utf8_lossy(line);
    if line.split_ascii_whitespace().all(is_plain) {
        return line;
    }
    let words: Vec<_> = line.split_ascii_whitespace().map(plain).collect();
    Cow::Owned(words.join(" "))
}

fn is_plain(word: &str) -> bool {
    let bytes = word.as_bytes();
    let digit = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_digit);
    bytes.iter().enumerate().all(|(i, b)| match b {
        b'.' => i > 0 && digit(i - 1) && digit(i + 1),
        b => !b.is_ascii_alphabetic() || matches!(b, b'e' | b'E'),
    })
}

fn plain(word: &str) -> Cow<'_, str> {
    match word.parse::<f64>() {
        _ if is_plain(word) => Cow::Borrowed(word),
        Ok(number) if number.is_finite() => Cow::Owned(format!("{number:e}")),
        Ok(number) => Cow::Borrowed(if number == f64::NEG_INFINITY {
            "-1e999"
        } else {
            "1e999"
        }),
        Err(_) => Cow::Borrowed(word),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_grammar_lacks_is_rewritten() {
        assert_eq!(numbers(b" 1 -2.5e-3 +7\n"), " 1 -2.5e-3 +7\n");
        assert_eq!(
            numbers(b".5 5. -.25e1 nan -inf x\r\n"),
            "5e-1 5e0 -2.5e0 1e999 -1e999 x"
        );
    }
}
