//! What the key frames of a sequence have in common, so that their topology is compared without being read.

use super::header::Header;
use super::{File, size};
use crate::rounding::Position;
use crate::{Result, SceneError};
use ply_rs_bw::ply::{Encoding, PropertyType, ScalarType};
use std::io::{self, Read};
use std::path::Path;

/// All bytes of a binary file but those of its vertices, which come first.
pub(crate) struct Pattern {
    head: Vec<u8>,
    vertex_bytes: usize,
    tail: Vec<u8>,
    floats: Option<Floats>,
}

/// Where little-endian floats lie in rows of one length.
struct Floats {
    row: usize,
    xyz: [usize; 3],
}

impl Pattern {
    /// Of a file whose header and vertices end at these bytes.
    pub(super) fn of(header: &Header, (bytes, [start, end]): (&[u8], [usize; 2])) -> Option<Self> {
        let first = header.elements.first()?;
        let is_binary = header.encoding != Encoding::Ascii;
        (is_binary && first.name == "vertex").then(|| Self {
            head: bytes[..start].to_vec(),
            vertex_bytes: end - start,
            tail: bytes[end..].to_vec(),
            floats: Floats::of(header),
        })
    }

    /// Reads the positions of the `kept` vertices from a file that differs in its vertices alone. Another file has no result.
    pub(crate) fn read(&self, path: &Path, kept: &[u32]) -> Result<Option<Vec<Position>>> {
        let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
        let rest = bytes.strip_prefix(&self.head[..]);
        let rest = rest.and_then(|rest| rest.strip_suffix(&self.tail[..]));
        match rest.filter(|rows| rows.len() == self.vertex_bytes) {
            Some(rows) => Ok(Some(self.points(path, rows, kept)?)),
            None => Ok(None),
        }
    }

    /// Reads positions again from a file that [`Self::read`] accepted before.
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
        let mut file = File::open(path, &bytes)?;
        let first = file.header.elements.first().cloned();
        file.element(&first.expect("the header is that of the first file"))?;
        Ok(kept.map(|v| file.points[v]).collect())
    }
}

impl Floats {
    /// Of a header whose vertices are floats, or other numbers of fixed length beside these.
    fn of(header: &Header) -> Option<Self> {
        let vertex = header.element("vertex")?;
        let (mut row, mut xyz) = (0, [None; 3]);
        for (name, property) in &vertex.properties {
            let PropertyType::Scalar(kind) = &property.data_type else {
                return None;
            };
            if let Some(axis) = ["x", "y", "z"].iter().position(|axis| axis == name) {
                xyz[axis] = Some(row).filter(|_| *kind == ScalarType::Float);
            }
            row += size(kind);
        }
        let xyz = [xyz[0]?, xyz[1]?, xyz[2]?];
        (header.encoding == Encoding::BinaryLittleEndian).then_some(Self { row, xyz })
    }

    fn point(&self, rows: &[u8], vertex: usize) -> Position {
        let row = &rows[vertex * self.row..][..self.row];
        self.xyz.map(|at| {
            let bytes = row[at..].first_chunk();
            f32::from_le_bytes(*bytes.expect("a float ends within the row")).into()
        })
    }
}
