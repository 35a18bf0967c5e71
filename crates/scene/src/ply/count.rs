//! How many corners all faces have together, counted before any of them is kept.

use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyType, ScalarType};

/// Corners of all faces, as far as the file reaches.
pub(super) fn corners(header: &Header, body: &[u8]) -> usize {
    let elements = header.elements.values();
    match header.encoding {
        Encoding::Ascii => {
            let mut lines = body.split(|&b| b == b'\n');
            let each = |element: &ElementDef| {
                let lines = lines.by_ref().take(element.count);
                match element.name == "face" {
                    true => lines.map(|line| in_line(line, element)).sum(),
                    false => lines.map(|_| 0).sum::<usize>(),
                }
            };
            elements.map(each).sum()
        }
        encoding => {
            let is_big = encoding == Encoding::BinaryBigEndian;
            let mut body = body;
            let each = |element| in_bytes(&mut body, is_big, element);
            elements.map(each).sum()
        }
    }
}

fn is_corners(element: &ElementDef, property: &str) -> bool {
    element.name == "face" && matches!(property, "vertex_indices" | "vertex_index")
}

/// Corners of the face in a line.
fn in_line(line: &[u8], element: &ElementDef) -> usize {
    let words = line.split(u8::is_ascii_whitespace);
    let mut words = words.filter(|word| !word.is_empty());
    let mut corners = 0;
    for (name, property) in &element.properties {
        let Some(word) = words.next() else {
            break;
        };
        if let PropertyType::List(..) = property.data_type {
            let text = str::from_utf8(word).unwrap_or_default();
            let length = text.parse().unwrap_or(0);
            let found = words.by_ref().take(length).count();
            corners += if is_corners(element, name) { found } else { 0 };
        }
    }
    corners
}

/// Corners of all elements of a kind, which are taken from the front of `body`.
fn in_bytes(body: &mut &[u8], is_big: bool, element: &ElementDef) -> usize {
    if element.properties.is_empty() {
        return 0;
    }
    let mut corners = 0;
    for _ in 0..element.count {
        if body.is_empty() {
            break;
        }
        for (name, property) in &element.properties {
            let (length, each) = match &property.data_type {
                PropertyType::Scalar(each) => (1, each),
                PropertyType::List(count, each) => (number(body, is_big, count), each),
            };
            let found = length.min(body.len() / size(each));
            *body = &body[found * size(each)..];
            if found < length {
                *body = &[];
            }
            corners += if is_corners(element, name) { found } else { 0 };
        }
    }
    corners
}

/// A number taken from the front of `body`; 0 if it is none that counts.
fn number(body: &mut &[u8], is_big: bool, kind: &ScalarType) -> usize {
    let Some((bytes, rest)) = body.split_at_checked(size(kind)) else {
        *body = &[];
        return 0;
    };
    *body = rest;
    if matches!(kind, ScalarType::Float | ScalarType::Double) {
        return 0;
    }
    let digit = |number: usize, &byte: &u8| number << 8 | usize::from(byte);
    match is_big {
        true => bytes.iter().fold(0, digit),
        false => bytes.iter().rev().fold(0, digit),
    }
}

fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}
