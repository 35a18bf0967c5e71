//! Views into the output of a stage.

use crate::WgpuBackend;
use backend::{Inspect, Layout, Result};
use bvh_layout::Topology;
use geom::{Aabb, Point};

impl Inspect for WgpuBackend {
    fn positions(&mut self) -> Result<Vec<Point>> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let count = scene.animation.vertex_count();
        self.window
            .read(&self.gpu, &scene.positions[self.position], count)
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        match self.tree().shape.layout {
            Layout::Bvh2 => self.boxes_of_nodes(),
            Layout::Fast => self.boxes_unfolded(),
        }
    }

    fn rebuilt(&mut self) -> Result<Topology> {
        Ok(self.read_tree()?.topology)
    }
}

impl WgpuBackend {
    fn boxes_of_nodes(&mut self) -> Result<Vec<Aabb>> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let nodes: Vec<[f32; 8]> =
            self.window
                .read(&self.gpu, &tree.nodes, tree.shape.node_count as usize)?;
        let unscale = f64::from(scene.scale_exponent).exp2() as f32;
        let point = |p: &[f32]| [p[0] * unscale, p[1] * unscale, p[2] * unscale];
        let unpacked = |n: &[f32; 8]| Aabb {
            min: point(&n[..3]),
            max: point(&n[4..7]),
        };
        let boxes: Vec<_> = nodes.iter().map(unpacked).collect();
        match tree.made_here {
            true => Ok(self.read_tree()?.in_order(&boxes)),
            false => Ok(boxes),
        }
    }

    fn boxes_unfolded(&mut self) -> Result<Vec<Aabb>> {
        let positions = self.positions()?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let shape = &tree.shape;
        let (at, leaves) = (shape.leaf_triangles_at as usize, shape.leaf_count as usize);
        let words: Vec<u32> = self.window.read(&self.gpu, tree.topology(), at + leaves)?;
        let rows = shape.node_rows as usize;
        let nodes: Vec<[f32; 4]> = self.window.read(&self.gpu, &tree.nodes, rows)?;
        let (words, animation) = (&words[at..], &scene.animation);
        Ok(shaders::unfold(&nodes, words, animation, &positions))
    }
}
