//! Results of queries.

use crate::{MeshId, SceneHit};
use backend::HitsPool;
use geom::{copy_in_parallel, lock};
use std::fmt;
use std::sync::{Arc, Mutex};

/// A hit of a ray on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The mesh.
    pub mesh: MeshId,
    /// Index of the triangle in the mesh.
    pub triangle: u32,
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
}

/// The results of one query, in the order of its rays.
///
/// This is a handle: clones share the same results. It remains valid while later steps are prepared, on any thread, and
/// after the tracer is dropped. Its memory is reused for a later query once the last clone is dropped.
#[derive(Clone)]
pub struct Hits(Arc<PooledHits>);

struct PooledHits {
    hits: backend::Hits,
    numbering: Arc<Numbering>,
    pool: SharedHitsPool,
}

/// Memory of dropped hits, for reuse.
pub(crate) type SharedHitsPool = Arc<Mutex<HitsPool>>;

/// Maps triangle indices of a scene to meshes.
pub(crate) struct Numbering {
    /// Index of the first triangle of each mesh, and finally the number of all triangles.
    pub(crate) starts: Vec<usize>,
    /// Identifier of each mesh.
    pub(crate) ids: Vec<MeshId>,
}

impl Numbering {
    /// Returns the mesh of a triangle and its index there. Returns `None` if the scene has no such triangle. Results
    /// that were read from the program's buffer may contain any index.
    fn mesh_of(&self, triangle: u32) -> Option<(MeshId, u32)> {
        let triangle = triangle as usize;
        let mesh = self.starts.partition_point(|&first| first <= triangle) - 1;
        let id = *self.ids.get(mesh)?;
        Some((id, (triangle - self.starts[mesh]) as u32))
    }
}

impl Drop for PooledHits {
    fn drop(&mut self) {
        lock(&self.pool).put(std::mem::take(&mut self.hits));
    }
}

impl Hits {
    pub(crate) fn new(
        hits: backend::Hits,
        numbering: &Arc<Numbering>,
        pool: &SharedHitsPool,
    ) -> Self {
        Self(Arc::new(PooledHits {
            hits,
            numbering: Arc::clone(numbering),
            pool: Arc::clone(pool),
        }))
    }

    /// Returns the hits as the backend returned them.
    pub(crate) fn of_backend(&self) -> &backend::Hits {
        &self.0.hits
    }

    /// Returns the number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        let hits = &self.0.hits;
        hits.closest.len().max(hits.blocked.len())
    }

    /// Returns whether the query had no rays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the closest hit of a ray, or `None` for a miss, for an index out of range, and for a query without
    /// closest hits.
    #[must_use]
    pub fn closest(&self, ray: usize) -> Option<Hit> {
        let hit = self.in_scene().get(ray).filter(|hit| hit.is_hit())?;
        let (mesh, triangle) = self.0.numbering.mesh_of(hit.triangle)?;
        Some(Hit {
            mesh,
            triangle,
            t: hit.t,
            u: hit.u,
            v: hit.v,
        })
    }

    /// Returns whether a ray hit any triangle.
    #[must_use]
    pub fn is_hit(&self, ray: usize) -> bool {
        let closest = self.in_scene().get(ray).is_some_and(|hit| hit.is_hit());
        closest || self.any().get(ray).is_some_and(|&met| met != 0)
    }

    /// Returns the closest hits of all rays, without a copy. Triangle indices count through all meshes of the scene in
    /// the order in which the meshes were added: see [`Tracer::first_triangle`](crate::Tracer::first_triangle). Empty
    /// for a query without closest hits.
    #[must_use]
    pub fn in_scene(&self) -> &[SceneHit] {
        &self.0.hits.closest
    }

    /// Copies the hits of [`Hits::in_scene`], on several threads if there are many. Returns the number of copied hits:
    /// the number of closest hits, or the length of `to` if that is smaller.
    pub fn copy_to(&self, to: &mut [SceneHit]) -> usize {
        let count = to.len().min(self.in_scene().len());
        copy_in_parallel(&mut to[..count], &self.in_scene()[..count]);
        count
    }

    /// Returns one byte per ray: 1 if the ray hit any triangle, else 0. Empty for a query of closest hits. For a
    /// [picture](crate::Step::render), 1 means that the pixel's hit is in shadow.
    #[must_use]
    pub fn any(&self) -> &[u8] {
        &self.0.hits.blocked
    }

    /// Returns `t` of each ray's closest hit, infinite for a miss. Empty for a query without closest hits.
    pub fn distances(&self) -> impl ExactSizeIterator<Item = f32> {
        self.in_scene().iter().map(|hit| hit.t)
    }
}

impl fmt::Debug for Hits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hits of {} rays", self.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, Scene};

    #[test]
    fn indices_out_of_range_have_no_mesh() {
        let mut scene = Scene::new();
        let mut add =
            |triangles| scene.add(Mesh::fixed(&[[0.0; 3]], &vec![[0; 3]; triangles]).unwrap());
        let ids = vec![add(2), add(4)];
        let second = ids[1];
        let starts = vec![0, 2, 6];
        let numbering = Numbering { starts, ids };
        assert_eq!(numbering.mesh_of(5), Some((second, 3)));
        assert_eq!(numbering.mesh_of(6), None);
        assert_eq!(numbering.mesh_of(u32::MAX - 1), None);
    }
}
