//! The elements of a PLY file: vertices, faces and strips.

use super::ascii::AsciiBody;
use super::element::{Element, RESTART};
use super::header::PlyHeader;
use crate::mesh::{Colours, Paint, PolygonMesh, Polygons, SHORT_FACES, Skipped};
use crate::paging::ReadSize;
use crate::rounding::Position;
use crate::text::check_encoding;
use crate::{Location, Result, SceneError};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{ElementDef, Encoding, PropertyType, ScalarType};
use std::fmt::Display;
use std::path::Path;

pub(super) struct PlyFile<'a> {
    path: &'a Path,
    pub(super) header: PlyHeader,
    pub(super) bytes: &'a [u8],
    /// Unread part of the file.
    body: AsciiBody<'a>,
    /// Byte offsets of the end of the header and of the end of the vertices. Equal until the vertices are read.
    pub(super) ends: [usize; 2],
    pub(super) points: Vec<Position>,
    colours: Colours,
    face_colours: Colours,
    polygons: Polygons,
    /// Faces and strips with fewer than three vertices.
    short_faces: Skipped,
}

impl<'a> PlyFile<'a> {
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let malformed = |cause: String| SceneError::malformed(path, None, cause);
        check_encoding(bytes).map_err(malformed)?;
        let mut header = PlyHeader::read(bytes).map_err(|e| e.in_file(path))?;
        header.widen_text();
        let file = Self {
            path,
            bytes,
            body: AsciiBody::new(&bytes[header.bytes..], header.lines + 1),
            ends: [header.bytes; 2],
            header,
            points: Vec::new(),
            colours: Colours::default(),
            face_colours: Colours::default(),
            polygons: Polygons::default(),
            short_faces: Skipped::default(),
        };
        file.check_header()?;
        Ok(file)
    }

    /// Returns upper bounds for reading the file.
    pub(super) fn size(&self) -> ReadSize {
        // The header may declare more elements than the file contains. Each element takes at least one byte.
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
        // Bytes per vertex, face and further corner. They include spare capacity, because lists grow by doubling.
        let bytes = vertices * 84 + faces.saturating_mul(80) + more.saturating_mul(32);
        ReadSize {
            vertices,
            faces,
            bytes,
        }
    }

    /// Returns an upper bound of the number of corners: the size of all lists in the file, divided by the size of
    /// a corner.
    fn listed(&self) -> usize {
        let ascii = self.header.encoding == Encoding::Ascii;
        let size = |kind: &ScalarType| if ascii { 1 } else { size(kind) };
        let rest = self.body.rest;
        let words = rest.split(u8::is_ascii_whitespace);
        let all = if ascii {
            words.filter(|w| !w.is_empty()).count()
        } else {
            rest.len()
        };
        // Size of an element without its list items, in bytes, or in words of an ascii file.
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

    /// Checks that the header declares vertices with coordinates, and faces or strips with lists of integers,
    /// each at most once.
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
                        "the header has no '{name}' with a list property vertex_indices"
                    ));
                }
            }
        }
        Ok(())
    }

    pub(super) fn element(&mut self, definition: &ElementDef) -> Result<()> {
        // Elements without properties occupy no bytes, so the size of the file would not bound the loop below.
        if definition.properties.is_empty() {
            return Ok(());
        }
        let ascii = self.header.encoding == Encoding::Ascii;
        for index in 0..definition.count {
            let element = if ascii {
                let read = self.body.element(definition, index);
                read.map_err(|e| e.in_file(self.path))?
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
                    self.short_faces.add(place);
                    return Ok(());
                }
                if corners.contains(&RESTART) {
                    return Err(self.wrong(place, NEGATIVE));
                }
                self.polygons.push(corners);
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

    /// Returns the vertices of a face, or of strips separated by [`RESTART`]. Checks that all other indices exist,
    /// except in lists of fewer than three corners, which are skipped.
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
    /// triangles face the same side. Degenerate triangles that connect parts of the strip are kept, so that triangle
    /// indices match the file.
    fn strip(&mut self, place: Location, strip: &[u32]) {
        if matches!(strip.len(), 1 | 2) {
            self.short_faces.add(place);
        }
        for (index, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            let is_even = index.is_multiple_of(2);
            self.polygons
                .push(if is_even { [a, b, c] } else { [b, a, c] });
        }
    }

    pub(super) fn finish(mut self) -> Result<PolygonMesh> {
        self.body.check_end().map_err(|e| e.in_file(self.path))?;
        let vertices = self.points.len();
        self.polygons.vertices = vertices;
        self.polygons.check(self.path)?;
        let short_faces = self.short_faces.note(self.path, SHORT_FACES);
        let mut notes: Vec<_> = short_faces.into_iter().collect();
        if !self.body.rest.is_empty() {
            let (file, left) = (self.path.display(), self.body.rest.len());
            let note = format!("{file}: {left} bytes after the last element are ignored");
            notes.push(note);
        }
        let faces = self.polygons.faces().count();
        let paint = if self.colours.len() == vertices {
            Paint::Vertices(self.colours.into_display(self.path, &mut notes))
        } else if self.face_colours.len() == faces {
            Paint::Faces(self.face_colours.into_display(self.path, &mut notes))
        } else {
            Paint::None
        };
        Ok(PolygonMesh {
            points: self.points,
            polygons: self.polygons,
            paint,
            notes,
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

pub(super) fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}
