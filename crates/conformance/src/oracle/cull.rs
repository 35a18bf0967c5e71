//! A median-split tree of boxes, which discards triangles far from a ray's line. The ray-box test is in double precision.

use geom::{Aabb, Ray, Triangle};

/// Maximum number of triangles in a leaf, which is called a group here.
const GROUP: usize = 8;

/// A balanced tree of boxes over the active triangles.
#[derive(Clone, Debug)]
pub(super) struct CullTree {
    /// Heap order: the children of node `i` are `2i + 1` and `2i + 2`.
    nodes: Vec<Aabb>,
    order: Vec<u32>,
}

impl CullTree {
    /// Builds a tree over the triangles in `active`.
    pub(super) fn new(corners: &[Triangle], active: Vec<u32>) -> Self {
        let mut order = active;
        let groups = order.len().div_ceil(GROUP).next_power_of_two();
        let mut nodes = vec![Aabb::EMPTY; 2 * groups - 1];
        split(corners, &mut order, &mut nodes, 0, groups);
        Self { nodes, order }
    }

    /// Calls `visit` for every triangle that a valid ray may hit, in approximate order of distance.
    ///
    /// `visit` returns an upper bound of the relevant `t`. Triangles beyond the bound may be skipped.
    pub(super) fn near(&self, ray: &Ray, mut visit: impl FnMut(u32) -> f64) {
        let enter = |node: usize| entry(ray, &self.nodes[node]);
        let mut bound = f64::INFINITY;
        let mut stack = Vec::with_capacity(64);
        let groups = self.nodes.len().div_ceil(2);
        stack.extend(enter(0).map(|t| (t, 0, groups, &self.order[..])));
        while let Some((t, node, groups, order)) = stack.pop() {
            if t > bound {
                continue;
            }
            if groups == 1 {
                bound = order.iter().map(|&i| visit(i)).fold(bound, f64::min);
                continue;
            }
            let (left, right) = order.split_at(order.len() / 2);
            let below = |node, order| enter(node).map(|t| (t, node, groups / 2, order));
            let mut both = [below(2 * node + 1, left), below(2 * node + 2, right)];
            if both[0].map(|b| b.0) < both[1].map(|b| b.0) {
                both.swap(0, 1);
            }
            stack.extend(both.into_iter().flatten());
        }
    }
}

/// Computes the boxes of `node` and its descendants. The node contains the triangles in `order` and has `groups`
/// leaves.
fn split(corners: &[Triangle], order: &mut [u32], nodes: &mut [Aabb], node: usize, groups: usize) {
    let of = |&i: &u32| Aabb::of_triangle(&corners[i as usize]);
    let bounds = order.iter().map(of).fold(Aabb::EMPTY, Aabb::union);
    nodes[node] = bounds;
    if groups == 1 {
        return;
    }
    let length = |i: usize| f64::from(bounds.max[i]) - f64::from(bounds.min[i]);
    let longest = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j)));
    let axis = longest.unwrap_or(0);
    let key = |i: u32| -> f64 { corners[i as usize].iter().map(|p| f64::from(p[axis])).sum() };
    let middle = order.len() / 2;
    if middle > 0 {
        order.select_nth_unstable_by(middle, |&i, &j| key(i).total_cmp(&key(j)));
    }
    let (left, right) = order.split_at_mut(middle);
    split(corners, left, nodes, 2 * node + 1, groups / 2);
    split(corners, right, nodes, 2 * node + 2, groups / 2);
}

/// Returns a lower bound of `t` over all points of the box on the ray, within its interval. Returns `None` only if
/// there is no such point.
///
/// A quotient of a difference rounds twice, by less than `4 * 2^-53` of its value, and neither overflows nor underflows
/// for `f32` input. So each slab's exact interval is within the widened one.
fn entry(ray: &Ray, bounds: &Aabb) -> Option<f64> {
    if bounds.is_empty() {
        return None;
    }
    let (mut low, mut high) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for i in 0..3 {
        let (o, d) = (ray.origin[i], ray.direction[i]);
        if d == 0.0 {
            if o < bounds.min[i] || o > bounds.max[i] {
                return None;
            }
            continue;
        }
        let at = |plane: f32| (f64::from(plane) - f64::from(o)) / f64::from(d);
        let (p, q) = (at(bounds.min[i]), at(bounds.max[i]));
        let (near, far) = if d > 0.0 { (p, q) } else { (q, p) };
        low = low.max(near - 2.0 * f64::EPSILON * near.abs());
        high = high.min(far + 2.0 * f64::EPSILON * far.abs());
    }
    (low <= high).then_some(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn culls_boxes_beyond_the_bound() {
        let wall = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        // Walls at 0, 1, 2 and so on, eight at each position, in mixed order.
        let corners: Vec<Triangle> = (0..256).map(|i| wall((i * 7 % 32) as f32)).collect();
        let boxes = CullTree::new(&corners, (0..256).collect());
        for direction in [1.0, -1.0] {
            let origin = [if direction > 0.0 { -1.0 } else { 32.0 }, 0.1, 0.1];
            let ray = Ray::new(origin, [direction, 0.0, 0.0]);
            let at = |i: u32| f64::from((corners[i as usize][0][0] - origin[0]) * direction);
            let mut seen = Vec::new();
            boxes.near(&ray, |i| {
                seen.push(i);
                3.0_f64.max(at(i))
            });
            let near = (0..256).filter(|&i| at(i) <= 3.0).count();
            assert_eq!(seen.iter().filter(|&&i| at(i) <= 3.0).count(), near);
            assert!(seen.len() < 2 * near, "{} of {near}", seen.len());
        }
    }

    #[test]
    fn rounding_keeps_rays_through_box_corners() {
        // Enters at exactly 1 + (17/48) 2^-52, leaves at 1 + (18/48) 2^-52. The first rounds up to 1 + 2^-52, the
        // second down to 1.
        let x = -(2.0_f32.powi(-52) + 2.0_f32.powi(-56));
        let ray = Ray::new([x, -3.0 * 2.0_f32.powi(-55), 0.0], [3.0, 1.0, 0.0]);
        let bounds = Aabb {
            min: [3.0, 0.0, 0.0],
            max: [4.0, 1.0, 1.0],
        };
        assert!(entry(&ray, &bounds).is_some());
    }
}
