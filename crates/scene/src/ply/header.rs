//! The header of a PLY file: how numbers are written, and what elements there are.

use crate::SceneError;
use std::path::Path;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A type of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// What a property is to a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Of a vertex, along an axis.
    Coordinate(usize),
    /// Red, green or blue of a vertex or a face.
    Colour(usize),
    /// The vertices of a face.
    Corners,
    Ignored,
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) role: Role,
    /// The type of a list's length; nothing for a single number.
    pub(super) length: Option<Scalar>,
    pub(super) each: Scalar,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) lines: usize,
    /// What follows it.
    pub(super) body: &'a [u8],
    /// Bytes of the whole file.
    pub(super) size: usize,
}

impl<'a> Header<'a> {
    /// Reads the header at the start of a file, which must declare vertices with a place and faces with a list of integers.
    pub(super) fn read(path: &Path, file: &'a [u8]) -> Result<Self, SceneError> {
        let wrong = |cause: &str| SceneError::malformed(path, None, cause);
        let mut bytes = 0;
        let ends = file.split_inclusive(|&b| b == b'\n').any(|line| {
            bytes += line.len();
            line.ends_with(b"\n") && line.trim_ascii() == b"end_header"
        });
        if !ends {
            return Err(wrong("not a whole PLY header: no line 'end_header'"));
        }
        let (head, body) = file.split_at(bytes);
        let head = String::from_utf8_lossy(head);
        let (mut encoding, mut elements) = (None, Vec::new());
        for (number, line) in (1..).zip(head.lines()) {
            statement(line, number, &mut encoding, &mut elements).ok_or_else(|| {
                let cause = format!("{:?} is not understood in a PLY header", line.trim());
                SceneError::malformed(path, ("line", number), cause)
            })?;
        }
        check(&elements).map_err(|cause| wrong(&cause))?;
        Ok(Self {
            encoding: encoding.ok_or_else(|| wrong("the header has no line 'format'"))?,
            elements,
            lines: head.lines().count(),
            body,
            size: file.len(),
        })
    }
}

/// Takes in one line; nothing if it is not understood.
fn statement(
    line: &str,
    number: usize,
    encoding: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> Option<()> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["ply"] if number == 1 => {}
        _ if number == 1 => return None,
        ["comment" | "obj_info", ..] | ["end_header"] => {}
        ["format", name, _version] => {
            let found = match name {
                "ascii" => Encoding::Ascii,
                "binary_little_endian" => Encoding::LittleEndian,
                "binary_big_endian" => Encoding::BigEndian,
                _ => return None,
            };
            if encoding.replace(found).is_some_and(|last| last != found) {
                return None;
            }
        }
        ["element", name, count] => elements.push(Element {
            name: name.to_owned(),
            count: count.parse().ok()?,
            properties: Vec::new(),
        }),
        ["property", "list", length, each, name] => {
            let length = Scalar::named(length).filter(|length| length.is_integer())?;
            elements.last_mut()?.add(name, Some(length), each)?;
        }
        ["property", each, name] => elements.last_mut()?.add(name, None, each)?,
        _ => return None,
    }
    Some(())
}

fn check(elements: &[Element]) -> Result<(), String> {
    let mut rest = elements.iter();
    while let Some(element) = rest.next() {
        if rest.clone().any(|other| other.name == element.name) {
            return Err("the header declares an element twice".to_owned());
        }
    }
    let properties = elements.iter().flat_map(|e| &e.properties);
    let find = |role| properties.clone().find(|p| p.role == role);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if find(Role::Coordinate(axis)).is_none() {
            return Err(format!("the header has no vertex with a number {name}"));
        }
    }
    match find(Role::Corners) {
        None => Err("the header has no face with a list vertex_indices".to_owned()),
        Some(list) if list.each.is_integer() => Ok(()),
        Some(_) => Err("the vertices of faces are not declared as whole numbers".to_owned()),
    }
}

impl Element {
    fn add(&mut self, name: &str, length: Option<Scalar>, each: &str) -> Option<()> {
        let role = match (self.name.as_str(), name, length) {
            ("vertex", "x", None) => Role::Coordinate(0),
            ("vertex", "y", None) => Role::Coordinate(1),
            ("vertex", "z", None) => Role::Coordinate(2),
            (_, "red" | "r" | "diffuse_red", None) => Role::Colour(0),
            (_, "green" | "g" | "diffuse_green", None) => Role::Colour(1),
            (_, "blue" | "b" | "diffuse_blue", None) => Role::Colour(2),
            ("face", "vertex_indices" | "vertex_index", Some(_)) => Role::Corners,
            _ => Role::Ignored,
        };
        let each = Scalar::named(each)?;
        self.properties.push(Property { role, length, each });
        Some(())
    }
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The number that a word stands for; an integer of any size, for lists are longer than their declared type tells.
    pub(super) fn of_word(self, word: &[u8]) -> Option<f64> {
        let word = str::from_utf8(word).ok()?;
        match self {
            Self::F32 => word.parse::<f32>().ok().map(f64::from),
            Self::F64 => word.parse().ok(),
            _ => word.parse::<i64>().ok().map(|n| n as f64),
        }
    }

    /// Takes a number from the front of `bytes`.
    pub(super) fn of_bytes(self, bytes: &mut &[u8], big_endian: bool) -> Option<f64> {
        Some(match self {
            Self::I8 => i8::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::U8 => u8::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::I16 => i16::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::U16 => u16::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::I32 => i32::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::U32 => u32::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::F32 => f32::from_le_bytes(take(bytes, big_endian)?).into(),
            Self::F64 => f64::from_le_bytes(take(bytes, big_endian)?),
        })
    }
}

/// The bytes of a number from the front of `bytes`, the lowest first.
fn take<const N: usize>(bytes: &mut &[u8], big_endian: bool) -> Option<[u8; N]> {
    let (&(mut number), rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    if big_endian {
        number.reverse();
    }
    Some(number)
}
