//! Stanford PLY, ascii and binary, by `ply-rs-bw`.
//!
//! Elements are read one at a time, so that what is wrong is named by its
//! line or by its element, and nothing is kept that is not used.

mod element;
mod pattern;

use crate::Location;
use crate::mesh::{Mesh, Paint, Topology, compact};
use crate::stream::check_mesh;
use crate::{Result, Rgb, SceneError};
use element::{Element, numbers, whole_header};
use geom::Point;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyType, ScalarType};
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use pattern::Pattern;

pub(crate) fn read(path: &Path) -> Result<Mesh> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let mut file = File::open(path, &bytes)?;
    let (counts, need) = file.need();
    check_mesh(path, counts, need)?;
    let definitions: Vec<ElementDef> = file.header.elements.values().cloned().collect();
    for definition in &definitions {
        file.element(definition)?;
    }
    file.finish()
}

/// Writes a mesh with a colour for each triangle, little-endian, which keeps every bit of a position.
///
/// Read back by [`crate::open`] it has the same triangles in the same order, the same colours, and the same bits in every
/// coordinate; vertices that no triangle uses are dropped by the reader.
///
/// # Errors
/// What `out` returns.
///
/// # Panics
/// If there is not one colour a triangle.
pub fn write_ply(
    out: &mut dyn Write,
    points: &[Point],
    triangles: &[[u32; 3]],
    colours: &[Rgb],
) -> io::Result<()> {
    assert_eq!(triangles.len(), colours.len(), "one colour a triangle");
    let (vertices, faces) = (points.len(), triangles.len());
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\nelement face {faces}\n\
         property list uchar uint vertex_indices\nproperty uchar red\nproperty uchar green\n\
         property uchar blue\nend_header\n"
    )?;
    for coordinate in points.as_flattened() {
        out.write_all(&coordinate.to_le_bytes())?;
    }
    for (corners, colour) in triangles.iter().zip(colours) {
        out.write_all(&[3])?;
        out.write_all(corners.map(u32::to_le_bytes).as_flattened())?;
        out.write_all(colour)?;
    }
    Ok(())
}

struct File<'a> {
    path: &'a Path,
    header: Header,
    /// What is left of the file.
    rest: &'a [u8],
    bytes: &'a [u8],
    /// Where the header ends, and where the vertices do, once they were read.
    ends: [usize; 2],
    line: usize,
    points: Vec<Point>,
    colours: Vec<Rgb>,
    face_colours: Vec<Rgb>,
    topology: Topology,
}

impl<'a> File<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let malformed = |cause: &str| SceneError::malformed(path, None, cause);
        let Some(head) = whole_header(bytes) else {
            return Err(malformed("not a whole PLY header: no line 'end_header'"));
        };
        let rest = &bytes[head.len()..];
        let text = String::from_utf8_lossy(head);
        let mut reader = Reader::new(text.as_bytes());
        let header = Parser::<Element>::new().read_header(&mut reader);
        let header = header.map_err(|e| {
            let location = e.line().map(|line| ("line", line));
            SceneError::malformed(path, location, header_cause(&text, &e))
        })?;
        let is_element = |line: &&str| line.trim_start().starts_with("element");
        if text.lines().filter(is_element).count() != header.elements.len() {
            return Err(malformed("the header declares an element twice"));
        }
        let file = Self {
            path,
            header,
            rest,
            bytes,
            ends: [head.len(); 2],
            line: text.lines().count(),
            points: Vec::new(),
            colours: Vec::new(),
            face_colours: Vec::new(),
            topology: Topology::default(),
        };
        file.check_header()?;
        Ok(file)
    }

    /// Vertices and faces, and the bytes that reading them takes at most.
    fn need(&self) -> ([usize; 2], usize) {
        // More than there are bytes cannot be there, whatever the header says.
        let count = |name: &str| {
            let element = self.header.elements.get(name);
            element.map_or(0, |e| e.count.min(self.bytes.len()))
        };
        let [vertices, faces] = [count("vertex"), count("face")];
        // Every corner after a face's third makes another triangle.
        let more = self.listed().saturating_sub(3 * faces);
        // Lists grow by doubling.
        ([vertices, faces], vertices * 24 + faces * 56 + more * 32)
    }

    /// Numbers in lists, as far as the file reaches: corners, and what other lists hold, as if each were a corner.
    fn listed(&self) -> usize {
        let ascii = self.header.encoding == Encoding::Ascii;
        let size = |kind: &ScalarType| if ascii { 1 } else { size(kind) };
        let words = self.rest.split(u8::is_ascii_whitespace);
        let all = match ascii {
            true => words.filter(|w| !w.is_empty()).count(),
            false => self.rest.len(),
        };
        // What every element has: numbers, and lengths of lists.
        let own = |element: &ElementDef| {
            let kinds = element.properties.values().map(|p| match &p.data_type {
                PropertyType::Scalar(kind) | PropertyType::List(kind, _) => size(kind),
            });
            element.count.saturating_mul(kinds.sum())
        };
        let own = self.header.elements.values().map(own);
        let listed = all.saturating_sub(own.fold(0, usize::saturating_add));
        match self.corners() {
            Some(PropertyType::List(_, corner)) => listed / size(corner),
            _ => 0,
        }
    }

    fn corners(&self) -> Option<&PropertyType> {
        let properties = &self.header.elements.get("face")?.properties;
        let found = properties.get("vertex_indices");
        Some(&found.or_else(|| properties.get("vertex_index"))?.data_type)
    }

    fn wrong(&self, place: impl Into<Option<Location>>, cause: impl Display) -> SceneError {
        SceneError::malformed(self.path, place, cause)
    }

    /// There must be vertices with a place, and faces with a list of whole numbers.
    fn check_header(&self) -> Result<()> {
        let coordinate = |axis: &str| {
            let vertex = self.header.elements.get("vertex")?;
            Some(&vertex.properties.get(axis)?.data_type)
        };
        let wrong = |cause: &str| Err(self.wrong(None, cause));
        for axis in ["x", "y", "z"] {
            if !matches!(coordinate(axis), Some(PropertyType::Scalar(_))) {
                return wrong(&format!("the header has no vertex with a number {axis}"));
            }
        }
        if !self.header.elements.contains_key("face") {
            return wrong("the header has no element 'face'");
        }
        match self.corners() {
            Some(PropertyType::List(_, ScalarType::Float | ScalarType::Double)) => {
                wrong("the vertices of faces are not declared as whole numbers")
            }
            Some(PropertyType::List(..)) => Ok(()),
            _ => wrong("the header has no face with a list vertex_indices"),
        }
    }

    fn element(&mut self, definition: &ElementDef) -> Result<()> {
        let ascii = self.header.encoding == Encoding::Ascii;
        // Everything else takes a byte at least, so that no count can outlast the file.
        if definition.properties.is_empty() && !ascii {
            return Ok(());
        }
        for index in 0..definition.count {
            let element = if ascii {
                self.ascii(definition, index)?
            } else {
                self.binary(definition, index)?
            };
            self.take(definition, index, element)?;
        }
        if definition.name == "vertex" {
            self.ends[1] = self.bytes.len() - self.rest.len();
        }
        Ok(())
    }

    fn ascii(&mut self, definition: &ElementDef, index: usize) -> Result<Element> {
        let Some(line) = self.rest.split_inclusive(|&b| b == b'\n').next() else {
            let (name, count) = (&definition.name, definition.count);
            let cause =
                format!("the file is cut short: {count} '{name}' are declared, {index} are there");
            return Err(self.wrong(("line", self.line + 1), cause));
        };
        self.rest = &self.rest[line.len()..];
        self.line += 1;
        let read = Parser::<Element>::new().read_ascii_element(&numbers(line), definition);
        read.map_err(|_| {
            let line = String::from_utf8_lossy(line);
            let cause = format!("bad '{}' {index}: {}", definition.name, line_cause(&line));
            self.wrong(("line", self.line), cause)
        })
    }

    fn binary(&mut self, definition: &ElementDef, index: usize) -> Result<Element> {
        let parser = Parser::<Element>::new();
        let read = match self.header.encoding {
            Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut self.rest, definition),
            _ => parser.read_little_endian_element(&mut self.rest, definition),
        };
        read.map_err(|e| {
            let (name, count) = (&definition.name, definition.count);
            let cause = match e.kind() {
                std::io::ErrorKind::UnexpectedEof => {
                    format!("the file is cut short within '{name}' {index} of {count}")
                }
                _ => format!("bad '{name}' {index} of {count}: {e}"),
            };
            self.wrong(("byte", self.bytes.len() - self.rest.len()), cause)
        })
    }

    fn take(&mut self, definition: &ElementDef, index: usize, element: Element) -> Result<()> {
        match definition.name.as_str() {
            "vertex" => {
                self.points.push(element.point);
                self.colours.extend(element.colour());
            }
            "face" => {
                self.face_colours.extend(element.colour());
                let wrong = |cause: String| self.wrong(("face", index), cause);
                let corners = element.corners;
                let corners = corners.ok_or_else(|| wrong("a vertex index is negative".into()))?;
                let found = corners.len();
                if found < 3 {
                    let cause = format!("a face of {found} vertices, where 3 or more are expected");
                    return Err(wrong(cause));
                }
                self.topology.push(corners);
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Mesh> {
        let vertices = self.points.len();
        self.topology.vertices = vertices;
        for (face, corners) in self.topology.faces().enumerate() {
            if let Some(vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                let cause =
                    format!("vertex {vertex} does not exist, there are {vertices} (from 0)");
                return Err(self.wrong(("face", face), cause));
            }
        }
        self.topology.check(self.path)?;
        let mut notes = Vec::new();
        if !self.rest.iter().all(u8::is_ascii_whitespace) {
            let (file, left) = (self.path.display(), self.rest.len());
            let note = format!("{file}: {left} bytes after the last element are left out");
            notes.push(note);
        }
        let paint = if self.colours.len() == vertices {
            Paint::Vertices(self.colours)
        } else if self.face_colours.len() == self.topology.faces().count() {
            Paint::Faces(self.face_colours)
        } else {
            Paint::None
        };
        let mut triangles: Vec<_> = self.topology.triangles().map(|(_, t)| t).collect();
        let kept = compact(&mut triangles, vertices);
        let pattern = Pattern::of(&self.header, (self.bytes, self.ends), &kept);
        let points = kept.iter().map(|&v| self.points[v as usize]).collect();
        Ok(Mesh {
            points,
            triangles,
            topology: self.topology,
            paint,
            notes,
            pattern,
        })
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

/// What is wrong with a header: the line that the parser stops at, or else the parser's own words.
fn header_cause(header: &str, e: &ParseError) -> String {
    let line = e.line().and_then(|line| header.lines().nth(line - 1));
    match line {
        Some(line) => format!("{:?} is not understood in a PLY header", line.trim()),
        None => e.to_string(),
    }
}

fn line_cause(line: &str) -> String {
    let mut words = line.split_ascii_whitespace();
    match words.find(|word| word.parse::<f64>().is_err()) {
        Some(word) => format!("{word:?} is not a number"),
        None => format!("{:?} is not what the header declares", line.trim()),
    }
}

#[cfg(test)]
mod tests;
