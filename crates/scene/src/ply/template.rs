//! Fast path for key-frame sequences: files whose bytes differ only in the vertices have equal topology.

use super::header::PlyHeader;
use super::reader::{PlyFile, size};
use crate::rounding::Position;
use crate::{Result, SceneError};
use ply_rs_bw::ply::{Encoding, PropertyType, ScalarType};
use std::io::{self, Read};
use std::path::Path;

/// All bytes of a binary file except its vertices. Only files whose vertices precede all other elements have a
/// template.
pub(crate) struct PlyTemplate {
    head: Vec<u8>,
    vertex_bytes: usize,
    tail: Vec<u8>,
    floats: Option<Floats>,
}

/// Layout of a vertex row: the bytes of one vertex. x, y and z are little-endian 32-bit floats.
struct Floats {
    /// Size of a row, in bytes.
    row_bytes: usize,
    /// Byte offsets of x, y and z in a row.
    xyz_offsets: [usize; 3],
}

impl PlyTemplate {
    /// Returns the template of a file whose elements were read. Returns `None` for text files and for files that do not
    /// begin with their vertices.
    pub(super) fn of(file: &PlyFile<'_>) -> Option<Self> {
        let (header, bytes, [start, end]) = (&file.header, file.bytes, file.ends);
        let first = header.elements.first()?;
        let is_binary = header.encoding != Encoding::Ascii;
        (is_binary && first.name == "vertex").then(|| Self {
            head: bytes[..start].to_vec(),
            vertex_bytes: end - start,
            tail: bytes[end..].to_vec(),
            floats: Floats::of(header),
        })
    }

    /// Reads the positions of the `kept` vertices. Returns `None` if the file differs in more than its vertices.
    pub(crate) fn read(&self, path: &Path, kept: &[u32]) -> Result<Option<Vec<Position>>> {
        let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
        let rest = bytes.strip_prefix(&self.head[..]);
        let rest = rest.and_then(|rest| rest.strip_suffix(&self.tail[..]));
        match rest.filter(|rows| rows.len() == self.vertex_bytes) {
            Some(rows) => Ok(Some(self.points(path, rows, kept)?)),
            None => Ok(None),
        }
    }

    /// Reads positions from a file that [`Self::read`] has accepted before.
    pub(crate) fn read_again(&self, path: &Path, kept: &[u32]) -> Result<Vec<Position>> {
        let read = || -> io::Result<Vec<u8>> {
            let mut file = host::open(path)?;
            file.read_exact(&mut vec![0; self.head.len()])?;
            let mut rows = vec![0; self.vertex_bytes];
            file.read_exact(&mut rows)?;
            Ok(rows)
        };
        let rows = read().map_err(|e| SceneError::unreadable(path, e))?;
        self.points(path, &rows, kept)
    }

    fn points(&self, path: &Path, rows: &[u8], kept: &[u32]) -> Result<Vec<Position>> {
        let kept = kept.iter().map(|&v| v as usize);
        if let Some(floats) = &self.floats {
            return Ok(kept.map(|v| floats.point(rows, v)).collect());
        }
        let bytes = [&self.head[..], rows].concat();
        let mut file = PlyFile::open(path, &bytes)?;
        let first = file.header.elements.first().cloned();
        file.element(&first.expect("the header is that of the first file"))?;
        Ok(kept.map(|v| file.points[v]).collect())
    }
}

impl Floats {
    /// Returns the layout if all vertex properties are scalars, and x, y and z are little-endian 32-bit floats.
    /// Otherwise `None`.
    fn of(header: &PlyHeader) -> Option<Self> {
        let vertex = header.element("vertex")?;
        let (mut row_bytes, mut offsets) = (0, [None; 3]);
        for (name, property) in &vertex.properties {
            let PropertyType::Scalar(kind) = &property.data_type else {
                return None;
            };
            if let Some(axis) = ["x", "y", "z"].iter().position(|axis| axis == name) {
                offsets[axis] = Some(row_bytes).filter(|_| *kind == ScalarType::Float);
            }
            row_bytes += size(kind);
        }
        let xyz_offsets = [offsets[0]?, offsets[1]?, offsets[2]?];
        (header.encoding == Encoding::BinaryLittleEndian).then_some(Self {
            row_bytes,
            xyz_offsets,
        })
    }

    fn point(&self, rows: &[u8], vertex: usize) -> Position {
        let row = &rows[vertex * self.row_bytes..][..self.row_bytes];
        self.xyz_offsets.map(|offset| {
            let bytes = row[offset..].first_chunk();
            f32::from_le_bytes(*bytes.expect("a float ends within the row")).into()
        })
    }
}
