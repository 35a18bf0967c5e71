//! Views into the output of a stage.

use crate::VulkanBackend;
use backend::{Inspect, Result};
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

    fn rebuilt(&mut self) -> Result<Topology> {
        self.gpu.wait_idle()?;
        Ok(self.read_tree()?.topology)
    }
}
