//! The surface area heuristic's cost of a tree.

use crate::gather::is_usable;
use crate::{BinaryTree, Boxes, Subtree, join_if};
use geom::Aabb;

/// Number of leaves above which subtrees are summed in parallel.
const PARALLEL: u32 = 2048;

/// Returns the expected number of nodes that a random ray visits if it hits the root's box. Every node costs 1.
///
/// This is the sum of all nodes' areas over the root's area (MacDonald, Booth 1990). It is 0 for an empty tree and for
/// a root without area. Boxes that are empty or not finite add nothing. The order of summation follows the tree, so the
/// result has the same bits for every number of threads.
#[must_use]
pub fn sah_cost<B: Boxes + ?Sized>(tree: &BinaryTree, boxes: &B) -> f64 {
    let Some(root) = tree.root() else { return 0.0 };
    let (bounds, sum) = areas_below(tree, boxes, root);
    let area = bounds.half_area();
    if area > 0.0 { sum / area } else { 0.0 }
}

/// Returns the box of a subtree, and the sum of its nodes' half areas.
fn areas_below<B: Boxes + ?Sized>(tree: &BinaryTree, boxes: &B, node: Subtree) -> (Aabb, f64) {
    if node.leaves == 1 {
        let bounds = boxes.get(tree.order[node.first_leaf as usize]);
        let bounds = Some(bounds).filter(is_usable).unwrap_or(Aabb::EMPTY);
        return (bounds, bounds.half_area());
    }
    let [left, right] = tree.children(node);
    let ((a, below_a), (b, below_b)) = join_if(
        node.leaves > PARALLEL,
        || areas_below(tree, boxes, left),
        || areas_below(tree, boxes, right),
    );
    let bounds = a.union(b);
    (bounds, bounds.half_area() + (below_a + below_b))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::builder::tests::sized;

    /// Returns a wavy square of `n * n` boxes, in rows.
    fn waves(n: u32) -> Vec<Aabb> {
        let bounds = |i| {
            let (x, y) = ((i % n) as f32, (i / n) as f32);
            let z = (x * 0.3).sin() + (y * 0.2).cos();
            sized([x, y, z], [1.0, 1.5, 0.5])
        };
        (0..n * n).map(bounds).collect()
    }

    /// Returns a node's box, computed from its leaves.
    pub(crate) fn bounds(tree: &BinaryTree, node: Subtree, boxes: &[Aabb]) -> Aabb {
        let leaves = tree.triangles(node).iter().map(|&t| boxes[t as usize]);
        leaves.fold(Aabb::EMPTY, Aabb::union)
    }

    fn naive_cost(tree: &BinaryTree, boxes: &[Aabb]) -> f64 {
        let area = |node: Subtree| bounds(tree, node, boxes).half_area();
        let root = tree.root().unwrap();
        let (mut stack, mut sum) = (vec![root], 0.0);
        while let Some(node) = stack.pop() {
            sum += area(node);
            if node.leaves > 1 {
                stack.extend(tree.children(node));
            }
        }
        sum / area(root)
    }

    #[test]
    fn cost_matches_naive_sum() {
        let boxes = &waves(60)[..];
        let tree = BinaryTree::over(boxes);
        let (cost, naive) = (sah_cost(&tree, boxes), naive_cost(&tree, boxes));
        assert!((cost - naive).abs() <= 1e-12 * naive, "{cost} {naive}");
    }

    #[test]
    fn cost_ignores_empty_boxes() {
        let mut boxes = waves(2);
        let tree = BinaryTree::over(&boxes[..]);
        boxes[1] = Aabb::EMPTY;
        boxes[2].max[0] = f32::NAN;
        let root = boxes[0].union(boxes[3]).half_area();
        let cost = sah_cost(&tree, &boxes[..]);
        assert!(cost.is_finite() && cost * root >= boxes[0].half_area() + boxes[3].half_area());
        assert_eq!(sah_cost(&tree, &[Aabb::EMPTY; 4][..]), 0.0);
    }
}
