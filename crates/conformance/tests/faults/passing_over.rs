//! A tree of the reference, spoilt.

use backend::{Intersector, Result};
use bvh_layout::Topology;
use cpu_ref::bvh2::Bvh2;
use cpu_ref::tiles::{Counts, Output};
use cpu_ref::trace::TraceTask;
use cpu_ref::{Accelerator, Geometry, Unhittable};
use geom::{Aabb, Animation, Triangle};

/// Leaves the first triangle that moves where the first `preprocess` after adoption found it.
#[derive(Default)]
pub(crate) struct PassingOver {
    tree: Bvh2,
    /// That triangle's vertices.
    vertices: Option<[u32; 3]>,
    /// Where they were found.
    found: Option<Triangle>,
}

impl Accelerator for PassingOver {
    fn adopt(&mut self, tree: &Topology, animation: &Animation) -> Result<()> {
        let is_static = &animation.static_parts().triangles;
        let mut leaves = tree.leaf_triangles().iter();
        let moving = leaves.find(|&&t| !is_static[t as usize]);
        self.vertices = moving.map(|&t| animation.triangles()[t as usize]);
        self.found = None;
        self.tree.adopt(tree, animation)
    }

    fn preprocess(&mut self, geometry: &Geometry<'_>, intersector: Intersector) -> Unhittable {
        let mut positions = geometry.positions.to_vec();
        if let Some(vertices) = self.vertices {
            let corners = vertices.map(|v| positions[v as usize]);
            let found = *self.found.get_or_insert(corners);
            for (vertex, corner) in vertices.into_iter().zip(found) {
                positions[vertex as usize] = corner;
            }
        }
        let positions = &positions;
        let geometry = Geometry {
            positions,
            ..*geometry
        };
        self.tree.preprocess(&geometry, intersector)
    }

    fn refit(&mut self) -> (f64, Aabb) {
        self.tree.refit()
    }

    fn trace(&self, task: TraceTask<'_>, out: Output<'_>) -> Counts {
        self.tree.trace(task, out)
    }

    fn boxes(&self, geometry: &Geometry<'_>) -> Result<Vec<Aabb>> {
        self.tree.boxes(geometry)
    }
}
