//! `parry3d`: sequential binned builds (Wald 2007) and parallel refits. Leaf boxes and memory are reused.

use super::{Node, Rival};
use geom::{Aabb, Point, Ray};
use parry3d::math::Vector;
use parry3d::partitioning::{
    Bvh, BvhBuildStrategy, BvhLeafUpdateStatus, BvhNode, BvhWorkspace, TraversalAction,
};
use parry3d::query::RayCast;
use parry3d::shape::Triangle;
use rayon::prelude::*;

/// Tree of `parry3d::partitioning`.
#[derive(Default)]
pub(super) struct Parry {
    soup: Vec<Triangle>,
    tree: Bvh,
    workspace: BvhWorkspace,
    updates: Vec<(parry3d::bounding_volume::Aabb, u32, f32)>,
    statuses: Vec<BvhLeafUpdateStatus>,
}

impl Parry {
    fn update_leaves(&mut self) {
        for (at, triangle) in self.soup.iter().enumerate() {
            let bounds = triangle.local_aabb();
            self.tree.insert_or_update_partially(bounds, at as u32, 0.0);
        }
    }
}

impl Rival for Parry {
    fn name(&self) -> &'static str {
        "parry3d binned"
    }

    fn builds_in_parallel(&self) -> bool {
        false
    }

    fn refits_in_parallel(&self) -> Option<bool> {
        Some(true)
    }

    fn take(&mut self, triangles: &[geom::Triangle]) {
        let convert = |t: &geom::Triangle| {
            let [a, b, c] = t.map(Vector::from);
            Triangle::new(a, b, c)
        };
        self.soup = triangles.iter().map(convert).collect();
    }

    fn build(&mut self) {
        if self.tree.leaf_count() as usize == self.soup.len() {
            self.update_leaves();
            self.tree
                .rebuild(&mut self.workspace, BvhBuildStrategy::Binned);
            // The crate's own builds also end with a refit, which sorts nodes in depth-first order.
            self.tree.refit(&mut self.workspace);
            return;
        }
        let boxes = self.soup.iter().map(Triangle::local_aabb).enumerate();
        self.tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes);
    }

    fn refit(&mut self) {
        if rayon::current_num_threads() == 1 {
            self.update_leaves();
            self.tree.refit_without_opt();
            return;
        }
        let update = |(at, triangle): (usize, &Triangle)| (triangle.local_aabb(), at as u32, 0.0);
        let updates = self.soup.par_iter().enumerate().map(update);
        updates.collect_into_vec(&mut self.updates);
        self.tree
            .insert_or_update_batch_partially_parallel(&self.updates, &mut self.statuses);
        self.tree.refit_parallel(&mut self.workspace);
    }

    fn closest(&self, ray: &Ray) -> Option<(f32, u32)> {
        let ray_here = convert(ray);
        let test = |at: u32, best| self.soup[at as usize].cast_local_ray(&ray_here, best, false);
        let (triangle, t) = self.tree.cast_ray(&ray_here, ray.t_max, test)?;
        Some((t, triangle))
    }

    fn blocked(&self, ray: &Ray) -> bool {
        let ray_here = convert(ray);
        let mut blocked = false;
        self.tree.traverse(|node| {
            if node.cast_ray(&ray_here, ray.t_max) >= ray.t_max {
                return TraversalAction::Prune;
            }
            let test = |at| self.soup[at as usize].cast_local_ray(&ray_here, ray.t_max, false);
            blocked = node.leaf_data().and_then(test).is_some();
            match blocked {
                true => TraversalAction::EarlyExit,
                false => TraversalAction::Continue,
            }
        });
        blocked
    }

    fn nodes(&self) -> Vec<Node> {
        let root = self.tree.root_aabb();
        let bounds = |min: Vector, max: Vector| {
            let [min, max]: [Point; 2] = [min.into(), max.into()];
            Aabb { min, max }
        };
        let mut nodes = vec![(bounds(root.mins, root.maxs), 0)];
        self.tree.traverse(|node: &BvhNode| {
            let bounds = bounds(node.mins(), node.maxs());
            nodes.push((bounds, u32::from(node.is_leaf())));
            TraversalAction::Continue
        });
        nodes
    }
}

fn convert(ray: &Ray) -> parry3d::query::Ray {
    parry3d::query::Ray::new(ray.origin.into(), ray.direction.into())
}
