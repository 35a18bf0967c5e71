//! Other crates' trees, one file each: what every one can be asked, and the one cost that compares them.

mod bvh;
mod obvhs;
mod parry;

use self::bvh::Bvh;
use self::obvhs::Obvhs;
use self::parry::Parry;
use geom::{Aabb, Ray, Triangle};

/// Another crate's tree, with triangles in the crate's own form. Memory is reused where the crate allows it.
pub trait CrateTree: Send + Sync {
    /// Crate and variant.
    fn name(&self) -> &'static str;

    /// Whether a build uses more than one thread.
    fn builds_in_parallel(&self) -> bool {
        true
    }

    /// Whether a refit uses more than one thread; `None` if no tree can take new positions and keep its shape.
    fn refits_in_parallel(&self) -> Option<bool>;

    /// Takes triangles, outside of what is measured. They replace those of a tree that is refitted next.
    fn take(&mut self, triangles: &[Triangle]);

    /// Triangles to a tree that rays can traverse.
    fn build(&mut self);

    /// New positions of the same triangles to a tree of the same shape, where the crate can.
    fn refit(&mut self) {}

    /// Distance and triangle of the closest hit in `(0, t_max)`.
    fn closest(&self, ray: &Ray) -> Option<(f32, u32)>;

    /// Whether there is any hit in `(0, t_max)`.
    fn blocked(&self, ray: &Ray) -> bool;

    /// How many rays hit, where only `any` hit is asked for or the closest.
    fn count(&self, rays: &[Ray], any: bool) -> u64 {
        let is_hit = |ray: &&Ray| match any {
            true => self.blocked(ray),
            false => self.closest(ray).is_some(),
        };
        rays.iter().filter(is_hit).count() as u64
    }

    /// All nodes, the root first, others in any order.
    fn nodes(&self) -> Vec<Node>;
}

/// One of each, with these triangles and no tree yet.
pub fn trees(triangles: &[Triangle]) -> Vec<Box<dyn CrateTree>> {
    let mut all: Vec<Box<dyn CrateTree>> = vec![
        Box::new(Obvhs::<false>::default()),
        Box::new(Obvhs::<true>::default()),
        Box::new(Bvh::default()),
        Box::new(Parry::default()),
    ];
    all.iter_mut().for_each(|tree| tree.take(triangles));
    all
}

/// A node as the cost sees it: its box, and the triangles tested there; 0 for an inner node.
pub type Node = (Aabb, u32);

/// Expected steps of a random ray that meets the root (`nodes[0]`): traversal 1 for
/// each inner node, intersection 1 for each triangle of a leaf (MacDonald, Booth 1990).
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
    fn every_tree_hits_what_ours_hits_but_for_rounding() {
        let mesh = Mesh::open("demo:collide:3000").expect("demos open");
        let mut tracer = Tracer::ready(&mesh, Intersector::MollerTrumbore.into(), 1);
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
                // Built anew, or refitted to the start.
                tree.take(&start);
                match tree.refits_in_parallel() {
                    Some(_) => pool(threads).install(|| tree.refit()),
                    None => tree.build(),
                }
                let other = |ray: &Ray| tree.closest(ray).map_or(u32::MAX, |(_, t)| t);
                let pairs = primary.iter().zip(&closest);
                let wrong = pairs.filter(|(ray, hit)| other(ray) != hit.triangle);
                let pairs = shadow.iter().zip(&blocked);
                let dark = pairs.filter(|(ray, dark)| tree.blocked(ray) != (**dark == 1));
                let count = wrong.count() + dark.count();
                assert!(count < 512 * 320 / 1_000, "{}: {count}", tree.name());
            }
        }
    }
}
