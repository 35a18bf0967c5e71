//! Stanford PLY, ascii and binary, one key frame a file.
//!
//! Elements are read one at a time, so that what is wrong is named by its
//! line or by its element, and nothing is kept that is not used.

mod header;

use crate::mesh::{Mesh, Paint, Topology, check_mesh, compact};
use crate::{Rgb, SceneError};
use geom::Point;
use header::{Element, Encoding, Header, Role, Scalar};
use std::io::{self, Write};
use std::path::Path;

/// Reads one file.
pub(crate) fn read(path: &Path) -> Result<Mesh, SceneError> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let header = Header::read(path, &bytes)?;
    let mut reader = Reader::new(path, &header);
    let (counts, need) = reader.need();
    check_mesh(path, counts, need)?;
    let mut content = Content::default();
    for element in &header.elements {
        for index in 0..reader.count(element) {
            reader.element(element, index, |role, kind, x| content.set(role, kind, x))?;
            let wrong = |cause| SceneError::malformed(path, ("face", index), cause);
            content.keep(element).map_err(wrong)?;
        }
    }
    content.into_mesh(path, reader.rest)
}

/// Writes a mesh with a colour for each triangle, little-endian, which keeps every bit of a position.
///
/// Read back by [`crate::open`] it has the same triangles in the same order,
/// the same colours, and the same bits in every coordinate; vertices that no
/// triangle uses are dropped by the reader.
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

/// Reads elements in their order.
#[derive(Clone, Copy)]
struct Reader<'a> {
    path: &'a Path,
    header: &'a Header<'a>,
    /// What is left of the file.
    rest: &'a [u8],
    /// Lines read.
    line: usize,
}

const CUT_SHORT: &str = "the file is cut short";

impl<'a> Reader<'a> {
    fn new(path: &'a Path, header: &'a Header<'a>) -> Self {
        Self {
            path,
            header,
            rest: header.body,
            line: header.lines,
        }
    }

    /// Vertices and faces, and the bytes that reading them takes at most.
    fn need(mut self) -> ([usize; 2], usize) {
        let (mut counts, mut corners) = ([0; 2], 0_usize);
        'file: for element in &self.header.elements {
            // More than there are bytes cannot be there, whatever the header says.
            let count = element.count.min(self.header.size);
            match element.name.as_str() {
                "vertex" => counts[0] = count,
                "face" => counts[1] = count,
                _ => {}
            }
            for index in 0..self.count(element) {
                let count = |role, _, _| corners += usize::from(role == Role::Corners);
                if self.element(element, index, count).is_err() {
                    break 'file;
                }
            }
        }
        // Every corner after a face's third makes another triangle. Lists grow by doubling.
        let more = corners.saturating_sub(3 * counts[1]);
        (counts, counts[0] * 24 + counts[1] * 56 + more * 32)
    }

    /// How many elements of a kind there are to read.
    fn count(&self, element: &Element) -> usize {
        // Everything else takes a byte at least, so that no count can outlast the file.
        let nothing = element.properties.is_empty() && self.header.encoding != Encoding::Ascii;
        if nothing { 0 } else { element.count }
    }

    /// Tells each number of an element.
    fn element(
        &mut self,
        element: &Element,
        index: usize,
        tell: impl FnMut(Role, Scalar, f64),
    ) -> Result<(), SceneError> {
        let Element { name, count, .. } = element;
        if self.header.encoding != Encoding::Ascii {
            let (is_big, mut rest) = (self.header.encoding == Encoding::BigEndian, self.rest);
            let read = numbers(element, |kind| kind.of_bytes(&mut rest, is_big), tell);
            self.rest = rest;
            return read.map_err(|cause| {
                let cause = match cause {
                    CUT_SHORT => format!("{CUT_SHORT} within '{name}' {index} of {count}"),
                    cause => format!("bad '{name}' {index} of {count}: {cause}"),
                };
                let byte = self.header.size - rest.len();
                SceneError::malformed(self.path, ("byte", byte), cause)
            });
        }
        self.line += 1;
        let wrong = |cause| SceneError::malformed(self.path, ("line", self.line), cause);
        if self.rest.is_empty() {
            let cause = format!("{CUT_SHORT}: {count} '{name}' are declared, {index} are there");
            return Err(wrong(cause));
        }
        let end = self.rest.iter().position(|&b| b == b'\n');
        let (line, rest) = self.rest.split_at(end.map_or(self.rest.len(), |i| i + 1));
        self.rest = rest;
        let words = line.split(u8::is_ascii_whitespace);
        let mut words = words.filter(|word| !word.is_empty());
        let next = |kind: Scalar| kind.of_word(words.next()?);
        numbers(element, next, tell).map_err(|_| {
            let line = String::from_utf8_lossy(line);
            wrong(format!("bad '{name}' {index}: {}", line_cause(&line)))
        })
    }
}

/// Tells the numbers of one element.
fn numbers(
    element: &Element,
    mut next: impl FnMut(Scalar) -> Option<f64>,
    mut tell: impl FnMut(Role, Scalar, f64),
) -> Result<(), &'static str> {
    for property in &element.properties {
        let length = property.length.map_or(Some(1.0), &mut next);
        let length = length.ok_or(CUT_SHORT)?;
        if length < 0.0 {
            return Err("List length cannot be negative");
        }
        for _ in 0..length as u32 {
            let x = next(property.each).ok_or(CUT_SHORT)?;
            tell(property.role, property.each, x);
        }
    }
    Ok(())
}

/// What is wrong with a line of numbers.
fn line_cause(line: &str) -> String {
    let mut words = line.split_ascii_whitespace();
    match words.find(|word| word.parse::<f64>().is_err()) {
        Some(word) => format!("{word:?} is not a number"),
        None => format!("{:?} is not what the header declares", line.trim()),
    }
}

/// What was read, and the element at hand.
#[derive(Default)]
struct Content {
    points: Vec<Point>,
    colours: Vec<Rgb>,
    face_colours: Vec<Rgb>,
    topology: Topology,
    point: Point,
    colour: Rgb,
    /// One bit for each of red, green and blue that is there.
    colour_parts: u8,
    corners: Vec<f64>,
}

impl Content {
    fn set(&mut self, role: Role, kind: Scalar, x: f64) {
        match role {
            Role::Coordinate(axis) => self.point[axis] = x as f32,
            Role::Colour(part) => {
                self.colour_parts |= 1 << part;
                self.colour[part] = match kind {
                    Scalar::F32 => (x as f32 * 255.0) as u8,
                    Scalar::F64 => (x * 255.0) as u8,
                    _ => x as i64 as u8,
                };
            }
            Role::Corners => self.corners.push(x),
            Role::Ignored => {}
        }
    }

    /// Keeps the vertex or face that was read.
    fn keep(&mut self, element: &Element) -> Result<(), String> {
        let colour = (std::mem::take(&mut self.colour_parts) == 0b111).then_some(self.colour);
        if element.name == "vertex" {
            self.points.push(self.point);
            self.colours.extend(colour);
        } else if element.name == "face" {
            let count = self.corners.len();
            if self.corners.iter().any(|&x| x < 0.0) {
                return Err("a vertex index is negative".to_owned());
            }
            if count < 3 {
                return Err(format!(
                    "a face of {count} vertices, where 3 or more are expected"
                ));
            }
            self.topology.push(self.corners.drain(..).map(|x| x as u32));
            self.face_colours.extend(colour);
        }
        Ok(())
    }

    /// The whole mesh, but for `rest` of the file.
    fn into_mesh(mut self, path: &Path, rest: &[u8]) -> Result<Mesh, SceneError> {
        let vertices = self.points.len();
        self.topology.vertices = vertices;
        for (face, corners) in self.topology.faces().enumerate() {
            if let Some(vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                let cause =
                    format!("vertex {vertex} does not exist, there are {vertices} (from 0)");
                return Err(SceneError::malformed(path, ("face", face), cause));
            }
        }
        let mut notes = Vec::new();
        if !rest.iter().all(u8::is_ascii_whitespace) {
            let (file, left) = (path.display(), rest.len());
            notes.push(format!(
                "{file}: {left} bytes after the last element are left out"
            ));
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
        Ok(Mesh {
            points: kept.iter().map(|&v| self.points[v as usize]).collect(),
            triangles,
            topology: self.topology,
            paint,
            notes,
        })
    }
}

#[cfg(test)]
mod tests;
