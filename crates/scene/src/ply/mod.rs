//! Reader of Stanford PLY files, ascii and binary, with `ply-rs-bw` as the parser of elements.
//!
//! Elements are parsed one at a time, so that an error names its line or element and unused properties take no memory.

mod ascii;
mod element;
mod header;
mod pattern;
mod reader;

use crate::mesh::PolygonMesh;
use crate::{Result, Rgb, SceneError};
use geom::Point;
use reader::PlyFile;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use pattern::Pattern;

/// Contents of a file.
pub(crate) struct Ply {
    pub(crate) mesh: PolygonMesh,
    /// Bytes that later key frames repeat. `None` if the file cannot be compared without parsing.
    pub(crate) pattern: Option<Pattern>,
}

pub(crate) fn read(path: &Path) -> Result<Ply> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let mut file = PlyFile::open(path, &bytes)?;
    file.size().check(path)?;
    let definitions = file.header.elements.clone();
    for definition in &definitions {
        file.element(definition)?;
    }
    let pattern = Pattern::of(&file);
    Ok(Ply {
        mesh: file.finish()?,
        pattern,
    })
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

#[cfg(test)]
mod tests;
