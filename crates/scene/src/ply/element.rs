//! One vertex or face, filled by the parser as it goes; and the text of a file in the words that the parser knows.

use crate::Rgb;
use geom::Point;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::borrow::Cow;

/// What is used of an element of any kind.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) point: Point,
    /// Red, green and blue, as far as they are there.
    colour: [Option<u8>; 3],
    /// The vertices of a face; nothing if one of them is negative.
    pub(super) corners: Option<Vec<u32>>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match self.set(name, &property) {
            Some(()) => PropertyAccessResult::Set,
            None => PropertyAccessResult::Ignored,
        }
    }
}

impl Element {
    pub(super) fn colour(&self) -> Option<Rgb> {
        let [r, g, b] = self.colour;
        Some([r?, g?, b?])
    }

    fn set(&mut self, name: &str, property: &Property) -> Option<()> {
        match name {
            "x" => self.point[0] = property.to_f32_lossy()?,
            "y" => self.point[1] = property.to_f32_lossy()?,
            "z" => self.point[2] = property.to_f32_lossy()?,
            "red" | "r" | "diffuse_red" => self.colour[0] = Some(property.to_u8_color_lossy()?),
            "green" | "g" | "diffuse_green" => self.colour[1] = Some(property.to_u8_color_lossy()?),
            "blue" | "b" | "diffuse_blue" => self.colour[2] = Some(property.to_u8_color_lossy()?),
            "vertex_indices" | "vertex_index" => self.corners = property.to_u32_list(),
            _ => return None,
        }
        Some(())
    }
}

/// The header with its last line's end, or nothing if it has none.
pub(super) fn whole_header(bytes: &[u8]) -> Option<&[u8]> {
    let mut end = 0;
    let mut lines = bytes.split_inclusive(|&b| b == b'\n');
    lines.find(|line| {
        end += line.len();
        line.ends_with(b"\n") && line.trim_ascii() == b"end_header"
    })?;
    Some(&bytes[..end])
}

/// A line of numbers in the parser's grammar, which lacks the `nan`, `inf`, `.5` and `5.` that other programs write.
///
/// Numbers that are none become ones too large to be finite: either way the vertex is absent. What is no number at all is
/// left to the parser to refuse.
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
        Ok(f64::NEG_INFINITY) => Cow::Borrowed("-1e999"),
        Ok(_) => Cow::Borrowed("1e999"),
        Err(_) => Cow::Borrowed(word),
    }
}
