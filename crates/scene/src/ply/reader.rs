//! The elements of a PLY file: vertices, faces and strips.

use super::ascii::AsciiBody;
use super::element::{Element, NEGATIVE, RESTART};
use super::header::PlyHeader;
use crate::mesh::{Paint, PolygonMesh, Polygons, SHORT_FACES, Skipped, append, to_srgb};
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
    /// Unread part of the file. For a binary file, only `rest` is used.
    body: AsciiBody<'a>,
    /// Byte offsets of the end of the header and of the end of the vertices. Equal until the vertices are read.
    pub(super) ends: [usize; 2],
    pub(super) points: Vec<Position>,
    colours: Vec<[f32; 3]>,
    face_colours: Vec<[f32; 3]>,
    polygons: Polygons,
    /// Faces and strips with fewer than three vertices.
    short_faces: Skipped,
}

impl<'a> PlyFile<'a> {
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let malformed = |cause: String| SceneError::malformed(path, None, cause);
        check_encoding(bytes).map_err(malformed)?;
        let mut header = PlyHeader::read(path, bytes)?;
        header.widen_text();
        let file = Self {
            path,
            bytes,
            body: AsciiBody::new(path, &bytes[header.bytes..], header.lines + 1),
            ends: [header.bytes; 2],
            header,
            points: Vec::new(),
            colours: Vec::new(),
            face_colours: Vec::new(),
            polygons: Polygons::default(),
            short_faces: Skipped::default(),
        };
        file.check_header()?;
        Ok(file)
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
                return wrong(&format!(
                    "the header has no element 'vertex' with a scalar property '{axis}'"
                ));
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
        let used = ["vertex", "face", STRIPS];
        let used = used.into_iter().find(|name| *name == definition.name);
        for index in 0..definition.count {
            let element = if ascii {
                self.body.element(definition, index)?
            } else {
                self.binary(definition, index)?
            };
            if let Some(name) = used {
                let place = (name, index);
                let stored = self.store(place, element);
                stored.map_err(|cause| self.wrong(place, cause))?;
            }
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

    /// Stores an element of the kind `place.0`.
    fn store(&mut self, place: Location, element: Element) -> Result<(), String> {
        let colour = element.colour();
        match place.0 {
            "vertex" => {
                append(&mut self.points, element.point)?;
                colour.map_or(Ok(()), |colour| append(&mut self.colours, colour))
            }
            "face" => {
                let corners = self.corners(element)?;
                if corners.len() < 3 {
                    self.short_faces.add(place);
                    return Ok(());
                }
                if corners.contains(&RESTART) {
                    return Err(NEGATIVE.to_owned());
                }
                self.polygons.push(&corners)?;
                colour.map_or(Ok(()), |colour| append(&mut self.face_colours, colour))
            }
            _ => {
                let corners = self.corners(element)?;
                let mut strips = corners.split(|&v| v == RESTART);
                strips.try_for_each(|strip| self.strip(place, strip))
            }
        }
    }

    /// Returns the vertices of a face, or of strips separated by [`RESTART`]. Checks that these vertices exist.
    /// Lists of fewer than three corners are not checked, because they are skipped.
    fn corners(&self, element: Element) -> Result<Vec<u32>, String> {
        let corners = element.corners.ok_or(NEGATIVE)??;
        let vertices = self.header.element("vertex").map_or(0, |e| e.count);
        let is_missing = |v: &&u32| **v as usize >= vertices && **v != RESTART;
        match corners.iter().find(is_missing) {
            Some(vertex) if corners.len() > 2 => Err(format!(
                "vertex {vertex} does not exist, there are {vertices} (from 0)"
            )),
            _ => Ok(corners),
        }
    }

    /// Adds the triangles of a strip. The first two vertices of every second triangle are swapped, so that all
    /// triangles face the same side. Degenerate triangles that connect parts of the strip are kept, so that triangle
    /// indices match the file.
    fn strip(&mut self, place: Location, strip: &[u32]) -> Result<(), String> {
        if matches!(strip.len(), 1 | 2) {
            self.short_faces.add(place);
        }
        for (index, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            let is_even = index.is_multiple_of(2);
            self.polygons
                .push(&if is_even { [a, b, c] } else { [b, a, c] })?;
        }
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<PolygonMesh> {
        self.body.check_end()?;
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
            Paint::Vertices(to_srgb(&self.colours, self.path, &mut notes))
        } else if self.face_colours.len() == faces {
            Paint::Faces(to_srgb(&self.face_colours, self.path, &mut notes))
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
