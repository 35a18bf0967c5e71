//! Which meshes have their newest vertices on a device alone.

use crate::{Error, Mesh, MeshId, Result};
use std::collections::BTreeMap;
use std::ops::Range;

/// Those meshes, and others that had theirs there.
#[derive(Default)]
pub(crate) struct DeviceVertices {
    /// Whether a step that failed may have lost them, by mesh.
    lost: BTreeMap<usize, bool>,
    /// Where vertices are the host's again since a step was last submitted.
    returned: Vec<Range<usize>>,
}

impl DeviceVertices {
    /// A mesh's vertices, which lie there among all, came to the device.
    pub(crate) fn come(&mut self, mesh: usize, range: &Range<usize>) {
        self.returned.retain(|other| other != range);
        self.lost.insert(mesh, false);
    }

    /// Likewise, to the host.
    pub(crate) fn leave(&mut self, mesh: usize, range: &Range<usize>) {
        if self.lost.remove(&mesh).is_some() {
            self.returned.push(range.clone());
        }
    }

    /// Where the device is to forget its own.
    pub(crate) fn take_returned(&mut self) -> Vec<Range<usize>> {
        std::mem::take(&mut self.returned)
    }

    /// A step failed: nobody knows how far vertices came.
    pub(crate) fn lose(&mut self) {
        self.lost.values_mut().for_each(|lost| *lost = true);
    }

    /// Refuses steps as long as vertices that were lost have not come again.
    pub(crate) fn check(&self, meshes: &[Mesh]) -> Result<()> {
        let Some((mesh, _)) = self.lost.iter().find(|(_, lost)| **lost) else {
            return Ok(());
        };
        Err(Error::VerticesLost(MeshId::of(meshes, *mesh)))
    }
}
