//! Views into the output of a stage.

use crate::WgpuBackend;
use backend::{BackendError, Inspect, Result};
use bvh_layout::Topology;
use geom::{Aabb, Point};
use shaders::View;
use shaders::rebuild::BrokenTree;

impl Inspect for WgpuBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let count = scene.animation.vertex_count();
        self.window
            .read(&self.gpu, &scene.positions[self.position], count)
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        let positions = self.positions()?;
        self.view(|tree| tree.boxes(&positions))
    }

    fn rebuilt(&mut self) -> Result<Topology> {
        let made_here = self.tree().made_here;
        assert!(made_here, "the tree in use was made on the host");
        self.view(|tree| tree.topology())
    }
}

impl WgpuBackend {
    /// Looks at the tree in use, after all that was submitted.
    fn view<T>(&mut self, look: impl Fn(&View<'_>) -> Looked<T>) -> Result<T> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let (at, leaves) = (tree.shape.leaf_triangles_at, tree.shape.leaf_count);
        let (from, at) = match tree.build.as_ref().filter(|_| tree.made_here) {
            Some(build) => (build.sorted(), 0),
            None => (tree.topology(), at as usize),
        };
        let words: Vec<u32> = self.window.read(&self.gpu, from, at + leaves as usize)?;
        let rows = tree.shape.node_rows as usize;
        let rows: Vec<[u32; 4]> = self.window.read(&self.gpu, &tree.buffers.nodes, rows)?;
        let seen = look(&View {
            shape: &tree.shape,
            made_on_device: tree.made_here,
            rows: &rows,
            triangles: &words[at..],
            animation: &scene.animation,
        });
        seen.map_err(|e| BackendError::WrongTree(e.to_string()))
    }
}

type Looked<T> = std::result::Result<T, BrokenTree>;
