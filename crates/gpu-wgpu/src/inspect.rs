//! Views into the output of a stage.

use crate::WgpuBackend;
use backend::{Inspect, Result};
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

    fn rebuilt(&mut self) -> Result<Topology> {
        Ok(self.read_tree()?.topology)
    }
}
