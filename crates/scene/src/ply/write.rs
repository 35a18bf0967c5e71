//! One key frame as binary PLY, which keeps every bit of a position.

use crate::Rgb;
use geom::Point;
use std::io::{self, Write};

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
