//! Reader of Stanford PLY files, ascii and binary, with `ply-rs-bw` as the parser of elements.
//!
//! Elements are parsed one at a time, so that an error names its line or element and unused properties take no memory.

mod ascii;
mod element;
mod header;
mod pattern;
mod reader;

use crate::mesh::PolygonMesh;
use crate::{Result, SceneError};
use reader::PlyFile;
use std::path::Path;

pub(crate) use pattern::Pattern;

pub(crate) fn read(path: &Path) -> Result<PolygonMesh> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let mut file = PlyFile::open(path, &bytes)?;
    let definitions = file.header.elements.clone();
    for definition in &definitions {
        file.element(definition)?;
    }
    file.finish()
}

#[cfg(test)]
mod tests;
