//! What the key frames of a sequence have in common, so that their topology is compared without being read.

use super::File;
use crate::SceneError;
use geom::Point;
use ply_rs_bw::ply::{Encoding, Header};
use std::path::Path;

/// All bytes of a binary file but those of its vertices, which come first.
pub(crate) struct Pattern {
    head: Vec<u8>,
    vertex_bytes: usize,
    tail: Vec<u8>,
    /// Vertices that faces use.
    kept: Vec<u32>,
}

impl Pattern {
    /// Of a file whose header and vertices end at these bytes.
    pub(super) fn of(
        header: &Header,
        (bytes, [start, end]): (&[u8], [usize; 2]),
        kept: &[u32],
    ) -> Option<Self> {
        let first = header.elements.values().next()?;
        let is_binary = header.encoding != Encoding::Ascii;
        (is_binary && first.name == "vertex").then(|| Self {
            head: bytes[..start].to_vec(),
            vertex_bytes: end - start,
            tail: bytes[end..].to_vec(),
            kept: kept.to_vec(),
        })
    }

    /// Reads the positions of a file that differs in its vertices alone; nothing of another file.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn read(&self, path: &Path) -> Result<Option<Vec<Point>>, SceneError> {
        let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
        let rest = bytes.strip_prefix(&self.head[..]);
        let rest = rest.and_then(|rest| rest.strip_suffix(&self.tail[..]));
        if rest.is_none_or(|rows| rows.len() != self.vertex_bytes) {
            return Ok(None);
        }
        let mut file = File::open(path, &bytes)?;
        let first = file.header.elements.values().next().cloned();
        file.element(&first.expect("the header is that of the first file"))?;
        let points = self.kept.iter().map(|&v| file.points[v as usize]);
        Ok(Some(points.collect()))
    }
}
