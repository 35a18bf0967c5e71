//! The element type that the parser fills, and conversion of numbers to the parser's grammar.

use crate::paging::reserve;
use crate::rounding::Position;
use crate::text::number;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::fmt::Write;

/// Index that separates strips in a list of vertices. Files store it as -1.
pub(super) const RESTART: u32 = u32::MAX;

pub(super) const NEGATIVE: &str = "a vertex index is negative";

/// The properties that the reader uses, for a vertex, face or strip.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) point: Position,
    /// Red, green and blue, where present.
    colour: [Option<f32>; 3],
    /// Vertices of a face or strip, with [`RESTART`] for -1. An error if any other index is negative, or if there is
    /// too little memory.
    pub(super) corners: Option<Result<Vec<u32>, String>>,
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
    pub(super) fn colour(&self) -> Option<[f32; 3]> {
        let [r, g, b] = self.colour;
        Some([r?, g?, b?])
    }

    fn set(&mut self, name: &str, property: &Property) -> Option<()> {
        match name {
            "x" => self.point[0] = coordinate(property)?,
            "y" => self.point[1] = coordinate(property)?,
            "z" => self.point[2] = coordinate(property)?,
            "red" | "r" | "diffuse_red" => self.colour[0] = Some(component(property)?),
            "green" | "g" | "diffuse_green" => self.colour[1] = Some(component(property)?),
            "blue" | "b" | "diffuse_blue" => self.colour[2] = Some(component(property)?),
            "vertex_indices" | "vertex_index" => self.corners = Some(indices(property)),
            _ => return None,
        }
        Some(())
    }
}

/// Converts a coordinate without loss. Returns `None` for a list.
fn coordinate(property: &Property) -> Option<f64> {
    match property {
        Property::Int(value) => Some((*value).into()),
        Property::UInt(value) => Some((*value).into()),
        Property::Double(value) => Some(*value),
        other => other.to_f32_lossy().map(f64::from),
    }
}

/// Converts a colour component. Floats keep the file's value. Integers from 0 to 255 become 0 to 1.
fn component(property: &Property) -> Option<f32> {
    let value = property.to_f32_lossy()?;
    match property {
        Property::Float(_) | Property::Double(_) => Some(value),
        _ => Some((value / 255.0).clamp(0.0, 1.0)),
    }
}

fn indices(property: &Property) -> Result<Vec<u32>, String> {
    let signed = |v: i32| match v {
        -1 => Some(RESTART),
        v => u32::try_from(v).ok(),
    };
    match property {
        Property::ListChar(list) => converted(list, |v| signed(v.into())),
        Property::ListUChar(list) => converted(list, |v| Some(v.into())),
        Property::ListShort(list) => converted(list, |v| signed(v.into())),
        Property::ListUShort(list) => converted(list, |v| Some(v.into())),
        Property::ListInt(list) => converted(list, signed),
        Property::ListUInt(list) => converted(list, Some),
        _ => Err(NEGATIVE.to_owned()),
    }
}

fn converted<T: Copy>(list: &[T], index: impl Fn(T) -> Option<u32>) -> Result<Vec<u32>, String> {
    let mut indices = Vec::new();
    reserve(&mut indices, list.len())?;
    for &item in list {
        indices.push(index(item).ok_or(NEGATIVE)?);
    }
    Ok(indices)
}

/// Appends a number in the parser's grammar, which lacks the common forms `nan`, `inf`, `.5` and `5.`.
///
/// NaN and infinities become numbers that overflow to infinity. This suffices, because a triangle is
/// inactive whether its vertex is NaN or infinite. Words that are not numbers are unchanged, and the parser refuses
/// them.
pub(super) fn push_number(text: &mut String, word: &str) {
    text.push(' ');
    if is_plain(word) {
        text.push_str(word);
        return;
    }
    match number::<f64>(word) {
        None => text.push_str(word),
        Some(f64::NEG_INFINITY) => text.push_str("-1e999"),
        // Writing to a string cannot fail.
        Some(value) if value.is_finite() => write!(text, "{value:e}").unwrap_or_default(),
        Some(_) => text.push_str("1e999"),
    }
}

/// Returns `false` if `word` is a number in a form that the parser lacks. May return `true` for a word that is not a
/// number, because the parser refuses it.
pub(super) fn is_plain(word: &str) -> bool {
    let bytes = word.as_bytes();
    let digit = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_digit);
    bytes.iter().enumerate().all(|(i, b)| match b {
        b'.' => i > 0 && digit(i - 1) && digit(i + 1),
        b => !b.is_ascii_alphabetic() || matches!(b, b'e' | b'E'),
    })
}
