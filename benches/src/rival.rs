//! What every tree can be asked, and the one cost that compares trees.

use geom::{Aabb, Ray, Triangle};

/// Another crate's tree. Its memory is reused where the crate allows it.
pub trait Rival: Default + Send + Sync {
    /// Crate and variant.
    const NAME: &'static str;
    /// Whether a build uses more than one thread.
    const BUILDS_IN_PARALLEL: bool;
    /// Whether a tree can take new positions and keep its shape.
    const REFITS: bool = false;
    /// Whether a refit uses more than one thread.
    const REFITS_IN_PARALLEL: bool = false;
    /// The crate's own form of triangles, made outside of what is measured.
    type Soup: Send + Sync;

    /// Triangles in the crate's own form.
    fn soup(triangles: &[Triangle]) -> Self::Soup;

    /// Triangles to a tree that rays can traverse.
    fn build(&mut self, soup: &mut Self::Soup);

    /// New positions of the same triangles to a tree of the same shape.
    /// Does nothing unless [`Rival::REFITS`].
    fn refit(&mut self, _soup: &Self::Soup) {}

    /// Distance and triangle of the closest hit in `(0, t_max)`.
    fn closest(&self, soup: &Self::Soup, ray: &Ray) -> Option<(f32, u32)>;

    /// Whether there is any hit in `(0, t_max)`.
    fn blocked(&self, soup: &Self::Soup, ray: &Ray) -> bool;

    /// All nodes, the root first, others in any order; none if the crate keeps them to itself.
    fn nodes(&self, _soup: &Self::Soup) -> Vec<Node> {
        Vec::new()
    }
}

/// A node as the cost sees it.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Its box.
    pub bounds: Aabb,
    /// Triangles tested there; 0 for an inner node.
    pub triangles: u32,
}

/// Expected steps of a random ray that meets the root (`nodes[0]`): traversal 1 for
/// each inner node, intersection 1 for each triangle of a leaf (MacDonald, Booth 1990).
#[must_use]
pub fn sah_cost(nodes: &[Node]) -> f64 {
    let cost = |node: &Node| f64::from(node.triangles.max(1)) * node.bounds.half_area();
    let root = nodes.first().map_or(0.0, |root| root.bounds.half_area());
    nodes.iter().map(cost).sum::<f64>() / root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bvh, Mesh, Obvhs, Parry, camera, pool, shadow_rays};
    use backend::{Intersector, Method};

    /// Hits of primary and shadow rays that differ from ours, after a refit to the start.
    fn differing<R: Rival>(mesh: &Mesh, threads: usize) -> usize {
        let intersector = Intersector::MollerTrumbore;
        let method = Method {
            intersector,
            ..Method::default()
        };
        let mut tracer = crate::Tracer::ready(mesh, method, 1);
        let primary = camera(mesh, [512, 320]).rays().collect::<Vec<_>>();
        let shadow = shadow_rays(mesh, &primary, &mut tracer);
        let mut tree = R::default();
        let mut start = R::soup(&mesh.triangles(mesh.start()));
        if R::REFITS {
            tree.build(&mut R::soup(&mesh.triangles(mesh.middle())));
            pool(threads).install(|| tree.refit(&start));
        } else {
            tree.build(&mut start);
        }
        let hits = tracer.list(&primary, backend::QueryKind::Closest);
        let closest = hits.closest.clone();
        let blocked = &tracer.list(&shadow, backend::QueryKind::Any).blocked;
        assert!(closest.iter().filter(|hit| hit.is_hit()).count() > 10_000);
        assert!(blocked.contains(&0) && blocked.contains(&1));
        let other = |ray: &Ray| tree.closest(&start, ray).map_or(u32::MAX, |(_, t)| t);
        let pairs = primary.iter().zip(&closest);
        let wrong = pairs.filter(|(ray, hit)| other(ray) != hit.triangle);
        let pairs = shadow.iter().zip(blocked);
        let is_wrong = |(ray, is): &(&Ray, &u8)| tree.blocked(&start, ray) != (**is == 1);
        wrong.count() + pairs.filter(is_wrong).count()
    }

    #[test]
    fn every_tree_hits_what_ours_hits_but_for_rounding() {
        let mesh = Mesh::open("demo:collide:3000").expect("demos open");
        let few = 512 * 320 / 1_000;
        assert!(differing::<Obvhs<false>>(&mesh, 1) < few);
        assert!(differing::<Obvhs<true>>(&mesh, 1) < few);
        assert!(differing::<Bvh>(&mesh, 1) < few);
        assert!(differing::<Parry>(&mesh, 1) < few);
        assert!(differing::<Parry>(&mesh, 2) < few);
    }
}
