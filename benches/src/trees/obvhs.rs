//! `obvhs`: parallel locally ordered clustering (Meister, Bittner 2018).

use super::{CrateTree, Node};
use geom::{Aabb, Ray};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;

/// Tree with the crate's `fastest_build` preset.
#[derive(Default)]
pub(super) struct Obvhs {
    soup: Vec<Triangle>,
    builder: PlocBuilder,
    tree: Bvh2,
}

impl CrateTree for Obvhs {
    fn name(&self) -> &'static str {
        "obvhs fastest"
    }

    fn can_refit(&self) -> bool {
        true
    }

    fn set_triangles(&mut self, triangles: &[geom::Triangle]) {
        let convert = |t: &geom::Triangle| {
            let [v0, v1, v2] = t.map(Vec3A::from);
            Triangle { v0, v1, v2 }
        };
        self.soup = triangles.iter().map(convert).collect();
    }

    fn build(&mut self) {
        // Equivalent to the preset, but reuses memory.
        let params = BvhBuildParams::fastest_build();
        let mut indices = std::mem::take(&mut self.tree.primitive_indices);
        indices.clear();
        indices.extend(0..self.soup.len() as u32);
        self.builder.build_with_bvh(
            &mut self.tree,
            params.ploc_search_distance,
            &self.soup[..],
            indices,
            params.sort_precision,
            params.search_depth_threshold,
        );
    }

    fn refit(&mut self) {
        let Bvh2 {
            nodes,
            primitive_indices,
            ..
        } = &mut self.tree;
        for node in nodes.iter_mut().filter(|node| node.is_leaf()) {
            let (first, count) = (node.first_index as usize, node.prim_count as usize);
            let members = primitive_indices[first..first + count].iter();
            let boxes = members.map(|&t| self.soup[t as usize].aabb());
            if let Some(bounds) = boxes.reduce(|a, b| a.union(&b)) {
                node.set_aabb(bounds);
            }
        }
        self.tree.refit_all();
    }

    fn closest(&self, ray: &Ray) -> Option<(f32, u32)> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(convert(ray), &mut hit, |ray, at| {
            self.soup[self.tree.primitive_indices[at] as usize].intersect(ray)
        });
        let triangle = |at: u32| self.tree.primitive_indices[at as usize];
        (hit.primitive_id != u32::MAX).then(|| (hit.t, triangle(hit.primitive_id)))
    }

    fn blocked(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(convert(ray), |ray, at| {
            self.soup[self.tree.primitive_indices[at] as usize].intersect(ray)
        })
    }

    fn nodes(&self) -> Vec<Node> {
        let node = |node: &obvhs::bvh2::node::Bvh2Node| {
            let [min, max] = [node.aabb().min, node.aabb().max].map(|p| p.to_array());
            (Aabb { min, max }, node.prim_count)
        };
        self.tree.nodes.iter().map(node).collect()
    }
}

fn convert(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), 0.0, ray.t_max)
}
