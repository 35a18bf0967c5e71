//! Orders children so that rays to a given point visit the likely occluder first.
//!
//! An any-hit traversal ends at its first hit, so the order of children matters, and all rays to a point light share
//! one end. The child whose box extends less far from the light comes first. This is usually the nearer child or, at
//! equal distances, the smaller one. Most shadowed points are on the far side of an object, as seen from the light. The
//! near side occludes them, so the nearer child more often contains the occluder. The order is part of the tree, so
//! traversal does not compute it.
//!
//! Other orders for such rays: Ize, Hansen, *RTSAH Traversal Order for Occlusion Rays*, 2011; Feltman, Lee, Fatahalian,
//! *SRDH: Specializing BVH Construction and Traversal Order Using Representative Shadow Ray Sets*, 2012; Nah, Manocha,
//! *SATO: Surface Area Traversal Order for Shadow Ray Tracing*, 2014.

use geom::{Aabb, Point};

/// Returns the squared distance from `from` to the farthest point of a box. It does not overflow an `f64` at any scale.
pub(crate) fn reach(b: &Aabb, from: Point) -> f64 {
    let along = |i: usize| (b.max[i] - from[i]).abs().max((from[i] - b.min[i]).abs());
    (0..3).map(|i| f64::from(along(i)).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::tests::{row, sized};
    use crate::cost::tests::bounds;
    use crate::small::MOST;
    use crate::{BinaryTree, Cancel, SahBuilder, tiny};
    use proptest::prelude::*;

    fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
        let corners = prop::array::uniform6(0_u8..200);
        let bounds = corners.prop_map(|c| {
            let [a, b, c, x, y, z] = c.map(f32::from);
            sized([a, b, c], [x, y, z].map(|e| e / 9.0))
        });
        prop::collection::vec(bounds, 1..300)
    }

    fn built(boxes: &[Aabb], toward: Option<Point>) -> BinaryTree {
        let (mut builder, mut tree) = (SahBuilder::default(), BinaryTree::default());
        builder.toward = toward;
        builder.build(boxes, &Cancel::new(), &mut tree).unwrap();
        tree
    }

    /// Returns the sorted triangles of each node, in an order that does not depend on the order of children. Also
    /// returns whether the first child never reaches farther than the second, in all nodes of more than `least` leaves.
    fn nodes(
        tree: &BinaryTree,
        boxes: &[Aabb],
        (point, least): (Point, u32),
    ) -> (Vec<Vec<u32>>, bool) {
        let (mut sets, mut in_order) = (Vec::new(), true);
        let mut waiting: Vec<_> = tree.root().into_iter().collect();
        while let Some(node) = waiting.pop() {
            let mut set = tree.triangles(node).to_vec();
            set.sort_unstable();
            sets.push(set);
            if node.leaves > 1 {
                let children = tree.children(node);
                let reaches = children.map(|c| reach(&bounds(tree, c, boxes), point));
                in_order &= node.leaves <= least || reaches[0] <= reaches[1];
                waiting.extend(children);
            }
        }
        sets.sort_unstable();
        (sets, in_order)
    }

    #[test]
    fn orders_large_nodes_at_any_scale() {
        let point = [60_000.0, -3.0, 200.0];
        let tiny = 2.0_f32.powi(-60);
        // Enough boxes for nodes to be divided by several threads.
        let [boxes, specks] = [1.0, tiny].map(|edge| row(50_000, edge));
        let plain = nodes(&built(&boxes, None), &boxes, (point, 0)).0;
        let ordered = built(&boxes, Some(point));
        let (sets, in_order) = nodes(&ordered, &boxes, (point, MOST as u32));
        assert!(in_order && sets == plain);
        assert!(built(&specks, Some(point.map(|x| x * tiny))) == ordered);
    }

    #[test]
    fn orders_small_nodes_toward_either_end() {
        let bounds = |i: usize| sized([2.0 * i as f32, 0.0, 0.0], [1.0; 3]);
        let few: Vec<_> = (0..MOST).map(bounds).collect();
        let plain = built(&few, None);
        for x in [-9.0, 99.0] {
            let point = [x, 3.0, 5.0];
            let ordered = built(&few, Some(point));
            let (sets, in_order) = nodes(&ordered, &few, (point, tiny::MOST as u32));
            assert!(in_order, "{x}");
            assert_eq!(sets, nodes(&plain, &few, (point, 0)).0);
            assert_eq!(ordered.order()[0] < 16, x < 0.0);
        }
    }

    proptest! {
        #[test]
        fn ordering_changes_only_child_order(
            boxes in boxes(),
            point in prop::array::uniform3(-300.0_f32..500.0),
        ) {
            let plain = built(&boxes, None);
            let (sets, _) = nodes(&plain, &boxes, (point, 0));
            let ordered = built(&boxes, Some(point));
            let (same, in_order) = nodes(&ordered, &boxes, (point, MOST as u32));
            prop_assert!(in_order);
            prop_assert_eq!(same, sets);
        }
    }
}
