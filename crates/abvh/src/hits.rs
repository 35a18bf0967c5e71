//! What rays met.

use crate::motion::Joined;
use crate::{MeshId, SceneHit};

/// Where a ray met a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The mesh.
    pub mesh: MeshId,
    /// The triangle's number in the mesh.
    pub triangle: u32,
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
}

/// What one query found, in the order of its rays, where it lies.
#[derive(Clone, Copy)]
pub struct Hits<'a> {
    pub(crate) found: &'a backend::Hits,
    pub(crate) joined: &'a Joined,
}

impl<'a> Hits<'a> {
    /// How many rays there were.
    #[must_use]
    pub fn len(&self) -> usize {
        self.found.closest.len().max(self.found.blocked.len())
    }

    /// Whether there were none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The closest hit of a ray. `None` if it met nothing, there is no such ray, or closest hits were not asked for.
    #[must_use]
    pub fn closest(&self, ray: usize) -> Option<Hit> {
        let hit = self.found.closest.get(ray).filter(|hit| hit.is_hit())?;
        let (mesh, triangle) = self.joined.mesh_of(hit.triangle);
        Some(Hit {
            mesh: MeshId::of(&self.joined.meshes, mesh),
            triangle,
            t: hit.t,
            u: hit.u,
            v: hit.v,
        })
    }

    /// Whether a ray met anything.
    #[must_use]
    pub fn is_hit(&self, ray: usize) -> bool {
        let closest = self.found.closest.get(ray).is_some_and(|hit| hit.is_hit());
        closest || self.found.blocked.get(ray).is_some_and(|&met| met != 0)
    }

    /// Closest hits as they lie, one a ray, to be read at once: triangles are numbered through all meshes of the scene, in the
    /// order in which these were added. Empty if closest hits were not asked for.
    #[must_use]
    pub fn in_scene(&self) -> &'a [SceneHit] {
        &self.found.closest
    }

    /// 1 for each ray that met anything, else 0. Empty if closest hits were asked for.
    #[must_use]
    pub fn any(&self) -> &'a [u8] {
        &self.found.blocked
    }

    /// `t` of closest hits, one a ray: infinite for a miss. Empty if closest hits were not asked for.
    pub fn distances(&self) -> impl ExactSizeIterator<Item = f32> + 'a {
        self.found.closest.iter().map(|hit| hit.t)
    }
}
