//! Reader of Stanford PLY files, ascii and binary, with `ply-rs-bw` as the parser of elements.
//!
//! Elements are parsed one at a time, so that an error names its line or element and unused properties take no memory.

mod ascii;
mod element;
mod header;
mod pattern;

use crate::mesh::{Colours, Mesh, Paint, Topology, short_faces_note};
use crate::rounding::Position;
use crate::stream::check_mesh;
use crate::text::check_encoding;
use crate::{Location, Result, Rgb, SceneError};
use ascii::Body;
use element::{Element, RESTART};
use geom::Point;
use header::Header;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{ElementDef, Encoding, PropertyType, ScalarType};
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use pattern::Pattern;

pub(crate) fn read(path: &Path) -> Result<Mesh> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let mut file = File::open(path, &bytes)?;
    let (counts, need) = file.need();
    check_mesh(path, counts, need)?;
    let definitions = file.header.elements.clone();
    for definition in &definitions {
        file.element(definition)?;
    }
    file.finish()
}

/// Writes a mesh with one colour per triangle as little-endian PLY. Positions keep every bit.
///
/// Reading the file with [`crate::open`] returns the same triangles in the same order, with equal colours and
/// bit-identical coordinates. The reader drops vertices that no triangle uses.
///
/// # Errors
/// Returns the errors of `out`.
///
/// # Panics
/// If `colours` and `triangles` differ in length.
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
    bytes: &'a [u8],
    /// Unread part of the file.
    body: Body<'a>,
    /// Byte offsets of the end of the header and, once the vertices are read, of their end.
    ends: [usize; 2],
    points: Vec<Position>,
    colours: Colours,
    face_colours: Colours,
    topology: Topology,
    /// Number of faces and strips with fewer than three vertices, and the location of the first.
    short_faces: usize,
    first_short_face: Location,
}

impl<'a> File<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let malformed = |cause: String| SceneError::malformed(path, None, cause);
        check_encoding(bytes).map_err(malformed)?;
        let mut header = Header::read(bytes).map_err(|(line, cause)| {
            let location = line.map(|line| ("line", line));
            SceneError::malformed(path, location, cause)
        })?;
        header.widen_text();
        let file = Self {
            path,
            bytes,
            body: Body::new(&bytes[header.bytes..], header.lines + 1),
            ends: [header.bytes; 2],
            header,
            points: Vec::new(),
            colours: Colours::default(),
            face_colours: Colours::default(),
            topology: Topology::default(),
            short_faces: 0,
            first_short_face: ("face", 0),
        };
        file.check_header()?;
        Ok(file)
    }

    /// Returns the number of vertices and faces, and an upper bound of the bytes needed to read them.
    fn need(&self) -> ([usize; 2], usize) {
        // No file holds more elements than bytes, whatever its header declares.
        let count = |name: &str| {
            let element = self.header.element(name);
            element.map_or(0, |e| e.count.min(self.bytes.len()))
        };
        let [vertices, mut faces] = [count("vertex"), count("face")];
        let listed = self.listed();
        // Each corner after the third adds a triangle to its face.
        let mut more = listed.saturating_sub(3 * faces);
        // Each corner of a strip adds a face.
        if count(STRIPS) > 0 {
            faces = faces.saturating_add(listed);
            more = 0;
        }
        // The constants include spare capacity, because lists grow by doubling.
        let need = vertices * 84 + faces.saturating_mul(80) + more.saturating_mul(32);
        ([vertices, faces], need)
    }

    /// Returns an upper bound of the number of corners: the numbers in all lists, as far as the file extends.
    fn listed(&self) -> usize {
        let ascii = self.header.encoding == Encoding::Ascii;
        let size = |kind: &ScalarType| if ascii { 1 } else { size(kind) };
        let rest = self.body.rest;
        let words = rest.split(u8::is_ascii_whitespace);
        let all = match ascii {
            true => words.filter(|w| !w.is_empty()).count(),
            false => rest.len(),
        };
        // Bytes or words that every element occupies: its numbers and the lengths of its lists.
        let own = |element: &ElementDef| {
            let kinds = element.properties.values().map(|p| match &p.data_type {
                PropertyType::Scalar(kind) | PropertyType::List(kind, _) => size(kind),
            });
            element.count.saturating_mul(kinds.sum())
        };
        let own = self.header.elements.iter().map(own);
        let listed = all.saturating_sub(own.fold(0, usize::saturating_add));
        let smallest = self.surfaces().filter_map(corners).map(|kind| match kind {
            PropertyType::List(_, corner) => size(corner),
            PropertyType::Scalar(kind) => size(kind),
        });
        smallest.min().map_or(0, |bytes| listed / bytes)
    }

    /// Returns the elements that contain faces or strips.
    fn surfaces(&self) -> impl Iterator<Item = &ElementDef> {
        ["face", STRIPS]
            .into_iter()
            .filter_map(|name| self.header.element(name))
    }

    fn wrong(&self, place: impl Into<Option<Location>>, cause: impl Display) -> SceneError {
        SceneError::malformed(self.path, place, cause)
    }

    /// Checks that vertices with coordinates, and faces or strips with lists of integers, are each declared once.
    fn check_header(&self) -> Result<()> {
        let wrong = |cause: &str| Err(self.wrong(None, cause));
        for name in ["vertex", "face", STRIPS] {
            let same = self.header.elements.iter().filter(|e| e.name == name);
            if same.count() > 1 {
                return wrong(&format!("the header declares an element twice: '{name}'"));
            }
        }
        let coordinate = |axis: &str| {
            let vertex = self.header.element("vertex")?;
            Some(&vertex.properties.get(axis)?.data_type)
        };
        for axis in ["x", "y", "z"] {
            if !matches!(coordinate(axis), Some(PropertyType::Scalar(_))) {
                return wrong(&format!("the header has no vertex with a number {axis}"));
            }
        }
        if self.surfaces().next().is_none() {
            let names = self.header.elements.iter().map(|e| format!("'{}'", e.name));
            let names: Vec<_> = names.collect();
            let names = names.join(", ");
            return wrong(&format!(
                "the header has no element 'face' or '{STRIPS}', only {names}"
            ));
        }
        for element in self.surfaces() {
            let name = &element.name;
            match corners(element) {
                Some(PropertyType::List(_, ScalarType::Float | ScalarType::Double)) => {
                    return wrong(&format!(
                        "the vertices of '{name}' are not declared as whole numbers"
                    ));
                }
                Some(PropertyType::List(..)) => {}
                _ => {
                    return wrong(&format!(
                        "the header has no '{name}' with a list vertex_indices"
                    ));
                }
            }
        }
        Ok(())
    }

    fn element(&mut self, definition: &ElementDef) -> Result<()> {
        // Elements without properties occupy no bytes, so their count is unbounded. Others occupy at least one byte.
        if definition.properties.is_empty() {
            return Ok(());
        }
        let ascii = self.header.encoding == Encoding::Ascii;
        for index in 0..definition.count {
            let element = if ascii {
                let read = self.body.element(definition, index);
                read.map_err(|(line, cause)| self.wrong(("line", line), cause))?
            } else {
                self.binary(definition, index)?
            };
            self.take(definition, index, element)?;
        }
        if definition.name == "vertex" {
            self.ends[1] = self.bytes.len() - self.body.rest.len();
        }
        Ok(())
    }

    fn binary(&mut self, definition: &ElementDef, index: usize) -> Result<Element> {
        let parser = Parser::<Element>::new();
        let read = match self.header.encoding {
            Encoding::BinaryBigEndian => {
                parser.read_big_endian_element(&mut self.body.rest, definition)
            }
            _ => parser.read_little_endian_element(&mut self.body.rest, definition),
        };
        read.map_err(|e| {
            let (name, count) = (&definition.name, definition.count);
            let cause = match e.kind() {
                std::io::ErrorKind::UnexpectedEof => {
                    format!("the file is cut short within '{name}' {index} of {count}")
                }
                _ => format!("bad '{name}' {index} of {count}: {e}"),
            };
            self.wrong(("byte", self.bytes.len() - self.body.rest.len()), cause)
        })
    }

    fn take(&mut self, definition: &ElementDef, index: usize, element: Element) -> Result<()> {
        match definition.name.as_str() {
            "vertex" => {
                self.points.push(element.point);
                if let Some(colour) = element.colour() {
                    self.colours.push(colour);
                }
            }
            "face" => {
                let place = ("face", index);
                let colour = element.colour();
                let corners = self.corners(place, element)?;
                if corners.len() < 3 {
                    self.skip_face(place);
                    return Ok(());
                }
                if corners.contains(&RESTART) {
                    return Err(self.wrong(place, NEGATIVE));
                }
                self.topology.push(corners);
                if let Some(colour) = colour {
                    self.face_colours.push(colour);
                }
            }
            STRIPS => {
                let place = (STRIPS, index);
                let corners = self.corners(place, element)?;
                let strips = corners.split(|&v| v == RESTART);
                strips.for_each(|strip| self.strip(place, strip));
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the vertices of a face, or of strips separated by [`RESTART`]. Checks that all other indices exist.
    fn corners(&self, place: Location, element: Element) -> Result<Vec<u32>> {
        let corners = element.corners;
        let corners = corners.ok_or_else(|| self.wrong(place, NEGATIVE))?;
        let vertices = self.header.element("vertex").map_or(0, |e| e.count);
        let is_missing = |v: &&u32| **v as usize >= vertices && **v != RESTART;
        match corners.iter().find(is_missing) {
            Some(vertex) if corners.len() > 2 => {
                let cause =
                    format!("vertex {vertex} does not exist, there are {vertices} (from 0)");
                Err(self.wrong(place, cause))
            }
            _ => Ok(corners),
        }
    }

    /// Adds the triangles of a strip. The first two vertices of every second triangle are swapped, so that all
    /// triangles face the same side. Degenerate triangles that connect parts of the strip are kept, because triangle
    /// indices count them.
    fn strip(&mut self, place: Location, strip: &[u32]) {
        if matches!(strip.len(), 1 | 2) {
            self.skip_face(place);
        }
        for (index, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            let is_even = index.is_multiple_of(2);
            self.topology
                .push(if is_even { [a, b, c] } else { [b, a, c] });
        }
    }

    fn skip_face(&mut self, place: Location) {
        if self.short_faces == 0 {
            self.first_short_face = place;
        }
        self.short_faces += 1;
    }

    fn finish(mut self) -> Result<Mesh> {
        if let Err((line, cause)) = self.body.check_end() {
            return Err(self.wrong(("line", line), cause));
        }
        let vertices = self.points.len();
        self.topology.vertices = vertices;
        self.topology.check(self.path)?;
        let mut notes = Vec::new();
        notes.extend(short_faces_note(
            self.path,
            self.short_faces,
            self.first_short_face,
        ));
        if !self.body.rest.is_empty() {
            let (file, left) = (self.path.display(), self.body.rest.len());
            let note = format!("{file}: {left} bytes after the last element are left out");
            notes.push(note);
        }
        let faces = self.topology.faces().count();
        let paint = if self.colours.len() == vertices {
            Paint::Vertices(self.colours.into_display(self.path, &mut notes))
        } else if self.face_colours.len() == faces {
            Paint::Faces(self.face_colours.into_display(self.path, &mut notes))
        } else {
            Paint::None
        };
        let pattern = Pattern::of(&self.header, (self.bytes, self.ends));
        Ok(Mesh {
            points: self.points,
            topology: self.topology,
            paint,
            notes,
            pattern,
        })
    }
}

/// Name of the element that contains triangle strips.
const STRIPS: &str = "tristrips";

const NEGATIVE: &str = "a vertex index is negative";

/// Returns the declared type of the list of vertices in a face or strip.
fn corners(element: &ElementDef) -> Option<&PropertyType> {
    let found = element.properties.get("vertex_indices");
    let found = found.or_else(|| element.properties.get("vertex_index"));
    Some(&found?.data_type)
}

fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

#[cfg(test)]
mod tests;
