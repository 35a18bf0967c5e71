//! One key frame as binary PLY, which keeps every bit of a position.

use crate::Rgb;
use geom::Point;
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, PropertyAccess, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;
use std::io::{self, Write};

/// Writes a mesh with a colour for each triangle, little-endian.
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
    mut out: &mut dyn Write,
    points: &[Point],
    triangles: &[[u32; 3]],
    colours: &[Rgb],
) -> io::Result<()> {
    assert_eq!(triangles.len(), colours.len(), "one colour a triangle");
    let [vertex, face] = [
        element("vertex", points.len(), &vertex_properties()),
        element("face", triangles.len(), &face_properties()),
    ];
    let mut header = Header::new();
    header.encoding = Encoding::BinaryLittleEndian;
    for definition in [&vertex, &face] {
        let name = definition.name.clone();
        header.elements.insert(name, definition.clone());
    }
    Writer::<Vertex>::new().write_header(&mut out, &header)?;
    let writer = Writer::new();
    for &point in points {
        writer.write_little_endian_element(&mut out, &Vertex(point), &vertex)?;
    }
    let writer = Writer::new();
    for (&corners, &colour) in triangles.iter().zip(colours) {
        writer.write_little_endian_element(&mut out, &Face { corners, colour }, &face)?;
    }
    Ok(())
}

fn element(name: &str, count: usize, properties: &[(&str, PropertyType)]) -> ElementDef {
    let mut definition = ElementDef::new(name.to_owned());
    definition.count = count;
    for (name, data_type) in properties {
        let property = PropertyDef::new((*name).to_owned(), data_type.clone());
        definition.properties.insert((*name).to_owned(), property);
    }
    definition
}

fn vertex_properties() -> [(&'static str, PropertyType); 3] {
    ["x", "y", "z"].map(|axis| (axis, PropertyType::Scalar(ScalarType::Float)))
}

fn face_properties() -> [(&'static str, PropertyType); 4] {
    let part = || PropertyType::Scalar(ScalarType::UChar);
    let list = PropertyType::List(ScalarType::UChar, ScalarType::UInt);
    [
        ("vertex_indices", list),
        ("red", part()),
        ("green", part()),
        ("blue", part()),
    ]
}

struct Vertex(Point);

struct Face {
    corners: [u32; 3],
    colour: Rgb,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([0.0; 3])
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        let axis = ["x", "y", "z"].iter().position(|&axis| axis == name)?;
        Some(self.0[axis])
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self {
            corners: [0; 3],
            colour: [0; 3],
        }
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        let parts = ["red", "green", "blue"];
        let part = parts.iter().position(|&part| part == name)?;
        Some(self.colour[part])
    }

    fn get_list_uint(&self, name: &str) -> Option<&[u32]> {
        (name == "vertex_indices").then_some(&self.corners)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Options;

    #[test]
    fn every_bit_comes_back() {
        let points = [
            [-0.0, 1e-45, f32::MAX],
            [0.1, f32::NEG_INFINITY, -7.3e-9],
            [f32::from_bits(0x7fc0_1234), 16_777_217.0, 1.0 / 3.0],
            [2.0, 3.0, 4.0],
        ];
        let (triangles, colours) = ([[3, 1, 0], [2, 2, 1]], [[1, 2, 255], [0, 128, 7]]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("1.ply");
        let mut bytes = Vec::new();
        write_ply(&mut bytes, &points, &triangles, &colours).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let scene = crate::open(path.to_str().unwrap(), &Options::default()).unwrap();
        let bits = |points: &[Point]| points.iter().map(|p| p.map(f32::to_bits)).collect();
        let read: Vec<[u32; 3]> = bits(&scene.animation.keys()[0]);
        let written: Vec<_> = bits(&points);
        assert_eq!(read, written);
        assert_eq!(scene.animation.triangles(), triangles);
        assert_eq!(scene.colours, colours);
        assert!(scene.facts.notes.is_empty());
    }

    #[test]
    fn a_disk_that_is_full_is_an_error() {
        let mut small = [0_u8; 300];
        let full = write_ply(&mut &mut small[..], &[[0.0; 3]; 100], &[], &[]);
        assert_eq!(full.unwrap_err().kind(), io::ErrorKind::WriteZero);
    }
}
