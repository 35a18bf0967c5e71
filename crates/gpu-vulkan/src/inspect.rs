//! Views into the output of a stage.

use crate::VulkanBackend;
use backend::{BackendError, Inspect, Result};
use bvh_layout::Topology;
use geom::{Aabb, Point};
use shaders::View;
use shaders::rebuild::BrokenTree;

impl Inspect for VulkanBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        self.gpu.wait_idle()?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let (from, count) = (
            &scene.positions[self.position],
            scene.animation.vertex_count(),
        );
        let (gpu, road) = (&self.gpu, &mut self.readback);
        Ok(self.window.look(gpu, road, from, count)?.to_vec())
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        let positions = self.positions()?;
        self.view(|tree| tree.boxes(&positions))
    }

    fn rebuilt(&mut self) -> Result<Topology> {
        let made_here = self.tree().made_here;
        assert!(made_here, "the tree in use was made on the host");
        self.gpu.wait_idle()?;
        self.view(|tree| tree.topology())
    }
}

impl VulkanBackend {
    /// Looks at the tree in use. All submissions must be finished.
    fn view<T>(&mut self, look: impl Fn(&View<'_>) -> Looked<T>) -> Result<T> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let (gpu, road) = (&self.gpu, &mut self.readback);
        let (at, leaves) = (tree.shape.leaf_triangles_at, tree.shape.leaf_count);
        let (from, at) = match tree.build.as_ref().filter(|_| tree.made_here) {
            Some(build) => (build.sorted(), 0),
            None => (tree.topology(), at as usize),
        };
        let words: &[u32] = self.window.look(gpu, road, from, at + leaves as usize)?;
        let triangles = words[at..].to_vec();
        let rows = tree.shape.node_rows as usize;
        let seen = look(&View {
            shape: &tree.shape,
            made_on_device: tree.made_here,
            rows: self.window.look(gpu, road, &tree.buffers.nodes, rows)?,
            triangles: &triangles,
            animation: &scene.animation,
        });
        seen.map_err(|e| BackendError::WrongTree(e.to_string()))
    }
}

type Looked<T> = std::result::Result<T, BrokenTree>;
