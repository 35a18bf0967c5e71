//! Views into the output of a stage.

use crate::VulkanBackend;
use backend::{Inspect, Layout, Result};
use bvh_layout::Topology;
use geom::{Aabb, Point};

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
        self.gpu.wait_idle()?;
        match self.tree().shape.layout {
            Layout::Bvh2 => self.boxes_of_nodes(),
            Layout::Fast => self.boxes_unfolded(),
        }
    }

    fn rebuilt(&mut self) -> Result<Topology> {
        self.gpu.wait_idle()?;
        Ok(self.read_tree()?.topology)
    }
}

impl VulkanBackend {
    fn boxes_of_nodes(&mut self) -> Result<Vec<Aabb>> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let count = tree.shape.node_count as usize;
        let made_here = tree.made_here;
        let (gpu, road) = (&self.gpu, &mut self.readback);
        let nodes: &[[f32; 8]] = self.window.look(gpu, road, &tree.nodes, count)?;
        let unscale = f64::from(scene.scale_exponent).exp2() as f32;
        let point = |p: &[f32]| [p[0] * unscale, p[1] * unscale, p[2] * unscale];
        let unpacked = |n: &[f32; 8]| Aabb {
            min: point(&n[..3]),
            max: point(&n[4..7]),
        };
        let boxes: Vec<_> = nodes.iter().map(unpacked).collect();
        match made_here {
            true => Ok(self.read_tree()?.in_order(&boxes)),
            false => Ok(boxes),
        }
    }

    fn boxes_unfolded(&mut self) -> Result<Vec<Aabb>> {
        let positions = self.positions()?;
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let shape = &tree.shape;
        let (gpu, road) = (&self.gpu, &mut self.readback);
        let (at, leaves) = (shape.leaf_triangles_at, shape.leaf_count);
        let words: &[u32] = self
            .window
            .look(gpu, road, tree.topology(), (at + leaves) as usize)?;
        let words = words[at as usize..].to_vec();
        let rows = shape.node_rows as usize;
        let nodes: &[[f32; 4]] = self.window.look(gpu, road, &tree.nodes, rows)?;
        Ok(shaders::unfold(nodes, &words, &scene.animation, &positions))
    }
}
