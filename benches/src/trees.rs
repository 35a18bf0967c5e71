//! Trees of other crates, one file each, behind one trait, and the cost function that compares them.

mod bvh;
mod obvhs;

use self::bvh::Bvh;
use self::obvhs::Obvhs;
use geom::{Aabb, Ray, Triangle};

/// A tree of another crate, with triangles in that crate's format. Memory is reused if the crate allows it.
pub trait CrateTree: Send + Sync {
    /// Returns the crate and its preset.
    fn name(&self) -> &'static str;

    /// Returns whether the crate can refit, which it does on one thread.
    fn can_refit(&self) -> bool;

    /// Stores `triangles` in the crate's format, for the next build or refit. This is not measured.
    fn set_triangles(&mut self, triangles: &[Triangle]);

    /// Builds a traversable tree from the triangles.
    fn build(&mut self);

    /// Refits the tree to new positions of the same triangles, if the crate supports it.
    fn refit(&mut self) {}

    /// Returns the distance and the triangle of the closest hit in `(0, t_max)`.
    fn closest(&self, ray: &Ray) -> Option<(f32, u32)>;

    /// Returns whether there is any hit in `(0, t_max)`.
    fn blocked(&self, ray: &Ray) -> bool;

    /// Returns the number of rays that hit, by any-hit queries if `any` is set, or else by closest-hit queries.
    fn count(&self, rays: &[Ray], any: bool) -> u64 {
        let is_hit = |ray: &&Ray| match any {
            true => self.blocked(ray),
            false => self.closest(ray).is_some(),
        };
        rays.iter().filter(is_hit).count() as u64
    }

    /// Returns all nodes, the root first and the others in any order.
    fn nodes(&self) -> Vec<Node>;
}

/// Returns one tree of each crate, with these triangles and not built yet.
pub fn trees(triangles: &[Triangle]) -> Vec<Box<dyn CrateTree>> {
    let mut all: Vec<Box<dyn CrateTree>> =
        vec![Box::new(Obvhs::default()), Box::new(Bvh::default())];
    all.iter_mut()
        .for_each(|tree| tree.set_triangles(triangles));
    all
}

/// A node for the cost function: its box, and its number of triangles, which is 0 for an inner node.
pub type Node = (Aabb, u32);

/// Returns the expected number of steps of a random ray that hits the root, `nodes[0]`.
///
/// Traversal costs 1 for each inner node, and intersection 1 for each triangle of a leaf (MacDonald, Booth 1990).
pub fn sah_cost(nodes: &[Node]) -> f64 {
    let cost = |(bounds, triangles): &Node| f64::from(*triangles.max(&1)) * bounds.half_area();
    let root = nodes.first().map_or(0.0, |root| root.0.half_area());
    nodes.iter().map(cost).sum::<f64>() / root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, Tracer, camera, pool, shadow_rays};
    use backend::{Intersector, QueryKind};

    #[test]
    fn hits_agree_across_tree_libraries() {
        let mesh = Mesh::open("demo:collide:3000").expect("demos open");
        let mut tracer = Tracer::ready(&mesh, Intersector::MollerTrumbore, 1);
        let primary = camera(&mesh, [512, 320]).rays().collect::<Vec<_>>();
        let shadow = shadow_rays(&mesh, &primary, &mut tracer);
        let closest = tracer.list(&primary, QueryKind::Closest).closest.clone();
        let blocked = tracer.list(&shadow, QueryKind::Any).blocked.clone();
        assert!(closest.iter().filter(|hit| hit.is_hit()).count() > 10_000);
        assert!(blocked.contains(&0) && blocked.contains(&1));
        let [start, middle] = [mesh.start(), mesh.middle()].map(|pose| mesh.triangles(pose));
        for threads in [1, 2] {
            for mut tree in trees(&middle) {
                pool(threads).install(|| tree.build());
                // Refit the tree to the start, or build it again if the crate cannot refit.
                tree.set_triangles(&start);
                if tree.can_refit() {
                    tree.refit();
                } else {
                    tree.build();
                }
                let other = |ray: &Ray| tree.closest(ray).map_or(u32::MAX, |(_, t)| t);
                let pairs = primary.iter().zip(&closest);
                let wrong = pairs.filter(|(ray, hit)| other(ray) != hit.triangle);
                let pairs = shadow.iter().zip(&blocked);
                let wrong_shadows = pairs.filter(|(ray, mark)| tree.blocked(ray) != (**mark == 1));
                let count = wrong.count() + wrong_shadows.count();
                assert!(count < 512 * 320 / 1_000, "{}: {count}", tree.name());
            }
        }
    }
}
