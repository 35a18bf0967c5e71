//! The tree once more, wide: for searches in which the invocations of a subgroup ask a child each.

use super::fill::LEAF as LEAF_OF_TREELET;
use super::{Treelet, Treelets, WideTree};

/// A binary node: an inner one by its number, or the leaf that begins with a triangle.
type Node = u32;
const LEAF: u32 = 1 << 31;

/// The binary tree that treelets hold.
struct Binary<'a> {
    tree: &'a Treelets,
    triangles: &'a [u32],
    /// Of each inner node, by its number.
    children: Vec<[Node; 2]>,
    /// First triangle and how many, likewise.
    spans: Vec<[u32; 2]>,
    root: Node,
}

impl<'a> Binary<'a> {
    fn of(tree: &'a Treelets) -> Self {
        let mut binary = Self {
            tree,
            triangles: &tree.words[tree.triangles_at()..][..tree.leaf_count()],
            children: vec![[0; 2]; tree.inner_count()],
            spans: vec![[0; 2]; tree.inner_count()],
            root: 0,
        };
        let (mut first_row, mut below) = (0, Vec::new());
        for level in tree.levels() {
            let treelets = level.clone().map(|t| tree.treelet(t as usize));
            let roots = treelets.flat_map(|t| {
                let place = (t.first_leaf.wrapping_sub(first_row) / 2) as usize;
                binary.read(t, below.get(place..).unwrap_or_default())
            });
            below = roots.collect();
            first_row = tree.treelet(level.start as usize).root_row;
        }
        binary.root = below[0];
        binary
    }

    /// Reads a treelet's inner nodes, which stand in the order of their heights; returns its roots.
    /// `below` are the roots that it stands on, and those after them; none for treelets of triangles.
    fn read(&mut self, t: Treelet, below: &[Node]) -> Vec<Node> {
        let tree = self.tree;
        let first = t.inner_row / 4 - 1;
        let node = |reference: u32| match (reference & LEAF_OF_TREELET, below) {
            (0, _) => first + reference,
            (_, []) => LEAF | (t.first_leaf + (reference & 255)),
            (_, all) => all[(reference & 255) as usize],
        };
        for &word in &tree.words[t.inner_at as usize..][..t.inner_count as usize] {
            let own = (first + (word >> 18 & 255)) as usize;
            self.children[own] = [word & 511, word >> 9 & 511].map(node);
            let [left, right] = self.children[own].map(|child| self.span(child));
            self.spans[own] = [left[0], left[1] + right[1]];
        }
        let roots = &tree.words[t.roots_at as usize..][..t.root_count as usize];
        roots.iter().map(|&root| node(root)).collect()
    }

    fn span(&self, node: Node) -> [u32; 2] {
        if node & LEAF == 0 {
            return self.spans[node as usize];
        }
        let first = node & !LEAF;
        let shares = self.triangles[first as usize] & Treelets::SHARED != 0;
        [first, 1 + u32::from(shares)]
    }

    fn is_block(&self, node: Node) -> bool {
        self.span(node)[1] <= WideTree::LANES as u32
    }

    fn block(&self, node: Node) -> u32 {
        let [first, count] = self.span(node);
        WideTree::BLOCK | goal(first, count)
    }

    /// The children of an inner node, each with the row of its box.
    fn open(&self, node: Node) -> [(Node, u32); 2] {
        let row = 4 * (node + 1);
        let [left, right] = self.children[node as usize];
        [(left, row), (right, row + 2)]
    }

    /// The subtrees that stand for an inner node: the largest is opened first.
    fn open_wide(&self, node: Node) -> Vec<(Node, u32)> {
        let mut lanes = Vec::with_capacity(WideTree::LANES);
        lanes.extend(self.open(node));
        while lanes.len() < WideTree::LANES {
            let nodes = lanes.iter().map(|&(node, _)| node).enumerate();
            let open = nodes.filter(|&(_, node)| !self.is_block(node));
            let Some((at, node)) = open.max_by_key(|&(_, node)| self.span(node)[1]) else {
                break;
            };
            let [left, right] = self.open(node);
            lanes[at] = left;
            lanes.push(right);
        }
        lanes
    }
}

/// Lanes as they are made, level by level.
#[derive(Default)]
struct Lanes {
    rows: Vec<u32>,
    goals: Vec<u32>,
}

impl Lanes {
    /// Adds a node's and tells where it begins, and which of its lanes lead to nodes yet to be made.
    fn add_node(&mut self, tree: &Binary<'_>, node: Node, next: &mut Vec<(Node, usize)>) -> u32 {
        let first = self.goals.len();
        for (child, row) in tree.open_wide(node) {
            self.rows.push(row);
            if tree.is_block(child) {
                self.goals.push(tree.block(child));
            } else {
                next.push((child, self.goals.len()));
                self.goals.push(0);
            }
        }
        goal(first as u32, (self.goals.len() - first) as u32)
    }

    fn into_tree(mut self, root: u32) -> WideTree {
        let lanes = self.goals.len();
        self.rows.append(&mut self.goals);
        WideTree {
            words: self.rows,
            lanes,
            root,
        }
    }
}

impl WideTree {
    /// Of treelets; `None` if they are of no triangle, of too many, or too deep.
    pub(super) fn of(tree: &Treelets) -> Option<Self> {
        if !(1..=Self::MOST_TRIANGLES).contains(&tree.leaf_count()) {
            return None;
        }
        let tree = Binary::of(tree);
        let mut lanes = Lanes::default();
        if tree.is_block(tree.root) {
            // Rows 0 and 1 are the box of all.
            lanes.rows.push(0);
            lanes.goals.push(tree.block(tree.root));
            return Some(lanes.into_tree(goal(0, 1)));
        }
        let mut level = Vec::new();
        let root = lanes.add_node(&tree, tree.root, &mut level);
        for _ in 1..Self::MOST_LEVELS {
            let mut next = Vec::new();
            for (node, lane) in level {
                lanes.goals[lane] = lanes.add_node(&tree, node, &mut next);
            }
            level = next;
        }
        level.is_empty().then(|| lanes.into_tree(root))
    }
}

/// Lanes of a node, or triangles of a block: the first, and how many.
fn goal(first: u32, count: u32) -> u32 {
    first << WideTree::FIRST_AT | count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{chain, random_tree, shapes};

    /// Triangles below a node, and the levels from it on.
    fn below(wide: &WideTree, node: u32, triangles: &mut Vec<u32>) -> usize {
        let (mut levels, lanes) = (0, wide.lane_count());
        assert!((1..=32).contains(&(node & 63)));
        for lane in (node >> 6)..(node >> 6) + (node & 63) {
            let goal = wide.words[lanes + lane as usize];
            if goal & WideTree::BLOCK == 0 {
                levels = levels.max(below(wide, goal, triangles));
            } else {
                let first = (goal & !WideTree::BLOCK) >> 6;
                assert!((1..=32).contains(&(goal & 63)));
                triangles.extend(first..first + (goal & 63));
            }
        }
        levels + 1
    }

    #[test]
    fn every_triangle_lies_below_one_lane_and_each_lane_has_a_box_of_its_own() {
        for tree in shapes()
            .into_iter()
            .chain([random_tree(9000, 5), chain(40)])
        {
            let treelets = Treelets::of_shape(tree.shape());
            let Some(wide) = treelets.wide() else {
                assert_eq!(treelets.leaf_count(), 0);
                continue;
            };
            let mut found = Vec::new();
            assert!(below(wide, wide.root(), &mut found) <= WideTree::MOST_LEVELS);
            found.sort_unstable();
            assert!(found.into_iter().eq(0..treelets.leaf_count() as u32));
            let mut rows = wide.words[..wide.lane_count()].to_vec();
            rows.sort_unstable();
            rows.dedup();
            assert_eq!(rows.len(), wide.lane_count(), "a row twice");
            assert!(
                rows.iter()
                    .all(|&r| r % 2 == 0 && (r as usize) < treelets.rows())
            );
        }
    }

    #[test]
    fn lanes_lead_where_their_boxes_belong() {
        let tree = random_tree(5000, 2);
        let treelets = Treelets::of_shape(tree.shape());
        let wide = treelets.wide().expect("a wide tree");
        let binary = Binary::of(&treelets);
        for lane in 0..wide.lane_count() {
            let row = wide.words[lane];
            let [left, right] = binary.children[(row / 4 - 1) as usize];
            let node = if row.is_multiple_of(4) { left } else { right };
            let goal = wide.words[wide.lane_count() + lane];
            if goal & WideTree::BLOCK != 0 {
                assert_eq!(goal, binary.block(node));
            } else {
                let mut found = Vec::new();
                below(wide, goal, &mut found);
                found.sort_unstable();
                let [first, count] = binary.span(node);
                assert!(found.into_iter().eq(first..first + count));
            }
        }
    }

    #[test]
    fn trees_of_too_many_triangles_have_none() {
        let most = WideTree::MOST_TRIANGLES;
        let of = |n| {
            Treelets::of_shape(random_tree(n, 1).shape())
                .wide()
                .is_some()
        };
        assert!(of(1) && of(most) && !of(most + 1) && !of(0));
    }
}
