//! The file header, which declares the elements in words separated by blanks.

use crate::text::lines;
use crate::{Result, SceneError};
use ply_rs_bw::ply::{Addable, ElementDef, Encoding, PropertyDef, PropertyType, ScalarType};
use std::path::Path;

pub(super) struct PlyHeader {
    pub(super) encoding: Encoding,
    /// Elements in file order. Names of unused elements may occur twice.
    pub(super) elements: Vec<ElementDef>,
    /// Length of the header in bytes, including the last line end.
    pub(super) bytes: usize,
    pub(super) lines: usize,
}

impl PlyHeader {
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let Some(length) = length(bytes) else {
            let cause = "the PLY header is incomplete: no line 'end_header'";
            return Err(SceneError::malformed(path, None, cause));
        };
        let mut declared = Declared::default();
        let mut count = 0;
        for line in lines(&bytes[..length]) {
            count += 1;
            let line = String::from_utf8_lossy(line);
            let words: Vec<_> = line.split_ascii_whitespace().collect();
            let known = match count {
                1 => matches!(words[..], ["ply" | "\u{feff}ply"]).then_some(()),
                _ => declared.add(&words),
            };
            known.ok_or_else(|| {
                let cause = format!("{:?} is not understood in a PLY header", line.trim());
                SceneError::malformed(path, ("line", count), cause)
            })?;
        }
        let no_format = || SceneError::malformed(path, None, "the header has no line 'format'");
        Ok(Self {
            encoding: declared.encoding.ok_or_else(no_format)?,
            elements: declared.elements,
            bytes: length,
            lines: count,
        })
    }

    /// Declares the coordinates of a text file as doubles, since its digits may exceed the precision of a float.
    pub(super) fn widen_text(&mut self) {
        let mut elements = self.elements.iter_mut();
        let vertex = elements.find(|e| e.name == "vertex" && self.encoding == Encoding::Ascii);
        let properties = vertex.into_iter().flat_map(|e| e.properties.iter_mut());
        for (name, property) in properties {
            let is_float = matches!(property.data_type, PropertyType::Scalar(ScalarType::Float));
            if is_float && matches!(name.as_str(), "x" | "y" | "z") {
                property.data_type = PropertyType::Scalar(ScalarType::Double);
            }
        }
    }

    pub(super) fn element(&self, name: &str) -> Option<&ElementDef> {
        self.elements.iter().find(|e| e.name == name)
    }
}

/// Returns the header's length in bytes, with the last line end. `None` if `end_header` or its line end is missing.
///
/// If lines end in a carriage return only, a line feed after the header belongs to the data.
fn length(bytes: &[u8]) -> Option<usize> {
    let first = lines(bytes).next()?;
    let ends = &bytes[first.len()..];
    let without_feeds = ends.starts_with(b"\r") && !ends.starts_with(b"\r\n");
    let mut start = 0;
    for line in lines(bytes) {
        let rest = &bytes[start + line.len()..];
        let end = match rest {
            [b'\r', b'\n', ..] if !without_feeds => 2,
            [] => 0,
            _ => 1,
        };
        if line.trim_ascii() == b"end_header" {
            return (end > 0).then_some(start + line.len() + end);
        }
        let feed = usize::from(rest.starts_with(b"\r\n"));
        start += line.len() + 1 + feed;
    }
    None
}

#[derive(Default)]
struct Declared {
    encoding: Option<Encoding>,
    elements: Vec<ElementDef>,
}

impl Declared {
    /// Adds a header line. Returns `None` if the line is not valid.
    fn add(&mut self, words: &[&str]) -> Option<()> {
        match *words {
            [] | ["comment" | "obj_info", ..] | ["end_header"] => {}
            ["format", encoding, _version] if self.encoding.is_none() => {
                self.encoding = Some(self::encoding(encoding)?);
            }
            ["element", name, count] => {
                let mut element = ElementDef::new(name.to_owned());
                element.count = count.parse().ok()?;
                self.elements.push(element);
            }
            ["property", kind, name] => {
                let kind = PropertyType::Scalar(scalar(kind)?);
                self.property(name, kind)?;
            }
            ["property", "list", length, item, name] => {
                let kind = PropertyType::List(scalar(length)?, scalar(item)?);
                self.property(name, kind)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Adds a property. Properties are stored by name, so a repeated name is replaced by a unique one. The property is
    /// then read but not used.
    fn property(&mut self, name: &str, kind: PropertyType) -> Option<()> {
        let properties = &mut self.elements.last_mut()?.properties;
        let mut name = name.to_owned();
        if properties.contains_key(&name) {
            name = format!("{name} {}", properties.len());
        }
        properties.add(PropertyDef::new(name, kind));
        Some(())
    }
}

fn encoding(word: &str) -> Option<Encoding> {
    Some(match word {
        "ascii" => Encoding::Ascii,
        "binary_big_endian" => Encoding::BinaryBigEndian,
        "binary_little_endian" => Encoding::BinaryLittleEndian,
        _ => return None,
    })
}

fn scalar(word: &str) -> Option<ScalarType> {
    Some(match word {
        "char" | "int8" => ScalarType::Char,
        "uchar" | "uint8" => ScalarType::UChar,
        "short" | "int16" => ScalarType::Short,
        "ushort" | "uint16" => ScalarType::UShort,
        "int" | "int32" => ScalarType::Int,
        "uint" | "uint32" => ScalarType::UInt,
        "float" | "float32" => ScalarType::Float,
        "double" | "float64" => ScalarType::Double,
        _ => return None,
    })
}
