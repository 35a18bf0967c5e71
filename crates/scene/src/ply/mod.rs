//! Reader of Stanford PLY files, ascii and binary, with `ply-rs-bw` as the parser of elements.
//!
//! Elements are parsed one at a time, so that an error names its line or element and unused properties take no memory.

mod ascii;
mod element;
mod header;
mod reader;
mod template;

use crate::mesh::PolygonMesh;
use crate::{Result, SceneError};
use reader::PlyFile;
use std::path::Path;

pub(crate) use template::PlyTemplate;

/// Contents of a mesh file.
pub(crate) struct MeshFile {
    pub(crate) mesh: PolygonMesh,
    /// Bytes by which a later key frame of equal topology is recognized without parsing it. `None` for text files and
    /// for files that do not begin with their vertices.
    pub(crate) template: Option<PlyTemplate>,
}

pub(crate) fn read(path: &Path) -> Result<MeshFile> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    let mut file = PlyFile::open(path, &bytes)?;
    let definitions = file.header.elements.clone();
    for definition in &definitions {
        file.element(definition)?;
    }
    let template = PlyTemplate::of(&file);
    Ok(MeshFile {
        mesh: file.finish()?,
        template,
    })
}

#[cfg(test)]
mod tests;
