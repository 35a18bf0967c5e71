//! Rebuilds a tree from subtrees of the previous tree. Keeps small compact subtrees, or *groups*, and builds the levels
//! above.
//!
//! Neighbouring triangles mostly move together. After some frames, most small subtrees are nearly as good as new ones,
//! and only the levels above have to change. So small subtrees of the previous tree become the primitives of a much
//! smaller build, with their nodes unchanged. Subtrees that came apart are divided first.
//!
//! Related work: Ganestam, Barringer, Doggett, Akenine-Möller (*Bonsai*, 2015) build in two levels from scratch. Yoon,
//! Curtis, Manocha (*Ray Tracing Dynamic Scenes using Selective Restructuring*, 2007) restructure only subtrees that
//! motion has degraded.

mod groups;

use crate::tree::SubtreeSlot;
use crate::{
    BinaryTree, BlockSize, Boxes, BuildError, Cancel, SahBuilder, Subtree, join_if, sah_cost,
};
use groups::{MAX_GROUP_HEIGHT, SubtreeGroups};
use rayon::prelude::*;

/// Number of groups above which a subtree is written in parallel.
const PARALLEL: u32 = 1024;

/// Builds trees from earlier trees. Keeps its memory.
#[derive(Debug, Default)]
pub struct SubtreeRebuilder {
    /// Compact subtrees of the previous tree.
    groups: SubtreeGroups,
    /// Tree whose leaves are the groups.
    above: BinaryTree,
    /// For each leaf of `above`, the number of triangles left of it. The last entry is the total.
    starts: Vec<u32>,
}

/// Costs of the previous and of the new tree. They equal [`sah_cost`] up to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeCosts {
    /// Cost of the previous tree with the new boxes.
    pub previous: f64,
    /// Cost of the new tree.
    pub new: f64,
}

impl SubtreeRebuilder {
    /// Builds `tree` over the triangles of the previous tree, whose current boxes are `boxes`. Reuses its compact
    /// subtrees. Returns the costs of both trees.
    ///
    /// `builder` builds the levels above these subtrees. The result depends on `previous`, `boxes` and
    /// [`SahBuilder::toward`] only.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`]; `tree` is then empty.
    ///
    /// # Panics
    /// If a triangle of the previous tree has a box that is empty or not finite.
    pub fn build<B: Boxes + ?Sized>(
        &mut self,
        builder: &mut SahBuilder,
        previous: &BinaryTree,
        boxes: &B,
        cancel: &Cancel,
        tree: &mut BinaryTree,
    ) -> Result<TreeCosts, BuildError> {
        tree.fill(cancel, |tree| {
            let areas = self.groups.find(previous, boxes);
            let (groups, above) = (&self.groups.boxes[..], &mut self.above);
            // Reserves levels for the groups below the leaves of `above`.
            builder.build_below(MAX_GROUP_HEIGHT, BlockSize::One, groups, cancel, above)?;
            self.count();
            let slot = tree.slot(previous.leaf_count());
            if let Some(root) = self.above.root() {
                self.unfold(previous, root, slot);
            }
            let over_root = |sum: f64| {
                if areas.root > 0.0 {
                    sum / areas.root
                } else {
                    0.0
                }
            };
            Ok(TreeCosts {
                previous: over_root(areas.all),
                new: over_root(areas.within_groups) + sah_cost(&self.above, &self.groups.boxes[..]),
            })
        })
    }

    /// Computes `starts` from the sizes of the groups.
    fn count(&mut self) {
        let leaves = |&group: &u32| self.groups.nodes[group as usize].leaves;
        let order = self.above.order.par_iter();
        order.map(leaves).collect_into_vec(&mut self.starts);
        let mut sum = 0;
        for start in &mut self.starts {
            sum += std::mem::replace(start, sum);
        }
        self.starts.push(sum);
    }

    /// Returns the number of triangles below a node of `above`.
    fn leaves(&self, node: Subtree) -> usize {
        let start = |leaf: u32| self.starts[leaf as usize] as usize;
        start(node.first_leaf + node.leaves) - start(node.first_leaf)
    }

    /// Writes the subtree below a node of `above`. Copies the nodes of each group from `previous`.
    fn unfold(&self, previous: &BinaryTree, node: Subtree, slot: SubtreeSlot<'_>) {
        if node.leaves == 1 {
            let group = self.groups.nodes[self.above.order[node.first_leaf as usize] as usize];
            slot.order.copy_from_slice(previous.triangles(group));
            let inner = &previous.left_leaves[group.inner as usize..][..slot.left_leaves.len()];
            return slot.left_leaves.copy_from_slice(inner);
        }
        let [a, b] = self.above.children(node);
        let [slot_a, slot_b] = slot.split(self.leaves(a));
        join_if(
            node.leaves > PARALLEL,
            || self.unfold(previous, a, slot_a),
            || self.unfold(previous, b, slot_b),
        );
    }
}

/// Tests with clumps of triangles that separate, change places or stay together.
#[cfg(test)]
mod tests {
    use super::groups::MOST;
    use super::*;
    use crate::MAX_DEPTH;
    use crate::builder::tests::sized;
    use geom::Aabb;
    use proptest::prelude::*;

    /// Returns `n` boxes in clumps of seven. `clump` maps a clump to its position, and `part` is the distance between
    /// its boxes.
    fn clumps(n: u32, clump: impl Fn(u32) -> f32, part: f32) -> Vec<Aabb> {
        let bounds = |i: u32| {
            let x = clump(i / 7) + (i % 7) as f32 * part;
            let min = [x, ((i / 7) % 5) as f32, (i % 7) as f32 * 0.1];
            sized(min, [1.0; 3])
        };
        (0..n).map(bounds).collect()
    }

    /// Returns the next tree, the costs of both trees, and the groups as subtrees of the previous tree.
    fn subtrees(previous: &BinaryTree, boxes: &[Aabb]) -> (BinaryTree, TreeCosts, Vec<Subtree>) {
        let (mut rebuilder, mut tree) = (SubtreeRebuilder::default(), BinaryTree::default());
        let mut builder = SahBuilder::default();
        let costs = rebuilder.build(&mut builder, previous, boxes, &Cancel::new(), &mut tree);
        (tree, costs.unwrap(), rebuilder.groups.nodes)
    }

    fn is_about(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * b.abs()
    }

    #[test]
    fn moved_groups_are_kept_whole() {
        let n = 7 * 3000;
        let before = clumps(n, |c| (c * 2) as f32, 0.05);
        let after = clumps(n, |c| (c * 1231 % 3000 * 2) as f32, 0.05);
        let previous = BinaryTree::over(&before[..]);
        let (tree, costs, groups) = subtrees(&previous, &after);
        assert!(groups.len() < 6000, "{}", groups.len());
        let fresh = sah_cost(&BinaryTree::over(&after[..]), &after[..]);
        let cost = sah_cost(&tree, &after[..]);
        assert!(cost < 1.1 * fresh, "{cost} {fresh}");
        assert!(costs.previous > 3.0 * cost, "{costs:?}");
        assert!(
            is_about(costs.new, cost) && is_about(costs.previous, sah_cost(&previous, &after[..]))
        );
    }

    #[test]
    fn scattered_groups_are_split() {
        let n = 7 * 300;
        let previous = BinaryTree::over(&clumps(n, |c| (c * 2) as f32, 0.05)[..]);
        // The boxes of each clump are now apart, among boxes of other clumps.
        let apart = clumps(n, |c| c as f32, 400.0);
        let (tree, _, groups) = subtrees(&previous, &apart);
        assert_eq!(groups.len(), n as usize);
        assert_eq!(tree, BinaryTree::over(&apart[..]));
    }

    #[test]
    #[should_panic(expected = "no usable box")]
    fn panics_on_empty_boxes() {
        let mut boxes = clumps(70, |c| c as f32, 0.1);
        let previous = BinaryTree::over(&boxes[..]);
        boxes[3] = Aabb::EMPTY;
        subtrees(&previous, &boxes);
    }

    #[test]
    fn subtree_build_is_deterministic_across_threads() {
        let n = 7 * 4000;
        let previous = BinaryTree::over(&clumps(n, |c| c as f32, 0.2)[..]);
        let after = clumps(n, |c| (c * 37 % 4000) as f32, 0.9);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let (tree, costs, _) = pool.unwrap().install(|| subtrees(&previous, &after));
            (tree, costs)
        };
        assert_eq!(on(1), on(4));
    }

    #[test]
    fn depth_does_not_exceed_maximum() {
        let cube = |min, size| sized(min, [size; 3]);
        // Every cube is 64 times as far out as the next one on its axis, so each plane separates a single cube.
        let mut boxes = Vec::new();
        for i in 0..78 {
            let (mut at, far) = ([0.0; 3], 2.0_f32.powi(58 - 6 * (i / 3) as i32));
            at[i % 3] = far;
            boxes.push(cube(at, far * 2.0_f32.powi(-18)));
        }
        // The cubes near the origin form groups.
        for i in 0..160 {
            let size = 2.0_f32.powi(-60 - i / 5);
            boxes.push(cube([size; 3], size / 4.0));
        }
        let previous = BinaryTree::over(&boxes[..]);
        let (tree, _, groups) = subtrees(&previous, &boxes);
        assert!(groups.len() < 78 + 80, "{}", groups.len());
        assert!(tree.depth(0) <= MAX_DEPTH);
    }

    #[test]
    fn trees_of_fewer_than_two_leaves_are_unchanged() {
        for n in [0, 1] {
            let boxes = clumps(n, |_| 0.0, 1.0);
            let previous = BinaryTree::over(&boxes[..]);
            assert_eq!(subtrees(&previous, &boxes).0, previous);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// For any motion, every triangle is in the tree once, and the costs are those of the trees.
        #[test]
        fn rebuilt_trees_are_complete(
            from in proptest::collection::vec(([-9.0_f32..9.0, -9.0_f32..9.0, -9.0_f32..9.0], 0.0_f32..3.0), 1..300),
            shift in 0.0_f32..20.0,
        ) {
            let at = |shift: f32| -> Vec<Aabb> {
                let moved = |(i, (p, r)): (usize, &([f32; 3], f32))| {
                    let min = [p[0] + shift * (i % 3) as f32, p[1], p[2] - shift * (i % 2) as f32];
                    sized(min, [*r; 3])
                };
                from.iter().enumerate().map(moved).collect()
            };
            let after = at(shift);
            let previous = BinaryTree::over(&at(0.0)[..]);
            let (tree, costs, groups) = subtrees(&previous, &after);
            let mut order = tree.order().to_vec();
            order.sort_unstable();
            prop_assert!(order.iter().copied().eq(0..from.len() as u32));
            prop_assert!(groups.iter().all(|g| g.leaves <= MOST));
            prop_assert!(tree.depth(0) <= MAX_DEPTH);
            prop_assert!(is_about(costs.new, sah_cost(&tree, &after[..])), "{:?}", costs);
            prop_assert!(is_about(costs.previous, sah_cost(&previous, &after[..])), "{:?}", costs);
        }
    }
}
