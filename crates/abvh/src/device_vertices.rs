//! Tracks the meshes whose newest vertices only the device has.

use crate::{Error, Mesh, MeshId, Result};
use std::collections::BTreeMap;
use std::ops::Range;

/// Meshes with vertices on the device, and meshes that got vertices from the host again.
#[derive(Default)]
pub(crate) struct DeviceVertices {
    /// For each mesh with vertices on the device, whether a failed step may have lost them.
    lost: BTreeMap<usize, bool>,
    /// Ranges of vertices that the host has provided again since the last submission.
    returned: Vec<Range<usize>>,
}

impl DeviceVertices {
    /// Records that the vertices of a mesh, which are `range` of all vertices, are on the device.
    pub(crate) fn insert(&mut self, mesh: usize, range: &Range<usize>) {
        self.returned.retain(|other| other != range);
        self.lost.insert(mesh, false);
    }

    /// Records that the host provides the vertices of a mesh.
    pub(crate) fn remove(&mut self, mesh: usize, range: &Range<usize>) {
        if self.lost.remove(&mesh).is_some() {
            self.returned.push(range.clone());
        }
    }

    /// Takes the ranges of vertices that the device must read from the host again.
    pub(crate) fn take_returned(&mut self) -> Vec<Range<usize>> {
        std::mem::take(&mut self.returned)
    }

    /// Marks all vertices on the device as lost, after a failed step.
    pub(crate) fn mark_lost(&mut self) {
        self.lost.values_mut().for_each(|lost| *lost = true);
    }

    /// Marks those vertices as lost that are lost in another scene, whose meshes have the same indices.
    #[cfg(feature = "wgpu")]
    pub(crate) fn copy_lost(&mut self, other: &Self) {
        for (mesh, lost) in &mut self.lost {
            *lost = other.lost.get(mesh) == Some(&true);
        }
    }

    /// Returns an error while lost vertices are not replaced.
    pub(crate) fn check(&self, meshes: &[Mesh]) -> Result<()> {
        let Some((mesh, _)) = self.lost.iter().find(|(_, lost)| **lost) else {
            return Ok(());
        };
        Err(Error::VerticesLost(MeshId::of(meshes, *mesh)))
    }
}
