//! The tree once more, wide: for searches in which the invocations of a subgroup ask a child each.

use super::fill::LEAF as LEAF_OF_TREELET;
use super::{Treelet, Treelets, WideTree};
use rayon::prelude::*;

/// Wide nodes that one task makes at least.
const RUN: usize = 16;

/// A binary node: an inner one by its number, or the leaf that begins with a triangle.
type Node = u32;
const LEAF: u32 = 1 << 31;

/// First triangle, and how many.
type Span = [u32; 2];

/// That of a leaf.
fn span_of_leaf(triangles: &[u32], leaf: Node) -> Span {
    let first = leaf & !LEAF;
    let shares = triangles[first as usize] & Treelets::SHARED != 0;
    [first, 1 + u32::from(shares)]
}

/// Reads the inner nodes of a treelet, which stand in the order of their heights; returns its roots. `below` are the roots
/// that it stands on, and those after them; none for treelets of triangles. `lower` are spans of the levels below.
fn read_treelet(
    tree: &Treelets,
    t: &Treelet,
    below: &[Node],
    lower: &[Span],
    children: &mut [[Node; 2]],
    spans: &mut [Span],
) -> Vec<Node> {
    let (first, triangles) = (t.inner_row / 4 - 1, tree.depth_first_triangles());
    let node = |reference: u32| match (reference & LEAF_OF_TREELET, below) {
        (0, _) => first + reference,
        (_, []) => LEAF | (t.first_leaf + (reference & 255)),
        (_, all) => all[(reference & 255) as usize],
    };
    for &word in &tree.words[t.inner_at as usize..][..t.inner_count as usize] {
        let own = (word >> 18 & 255) as usize;
        children[own] = [word & 511, word >> 9 & 511].map(node);
        let [left, right] = children[own].map(|child| match child {
            leaf if leaf & LEAF != 0 => span_of_leaf(triangles, leaf),
            own if own >= first => spans[(own - first) as usize],
            lower_one => lower[lower_one as usize],
        });
        spans[own] = [left[0], left[1] + right[1]];
    }
    let roots = &tree.words[t.roots_at as usize..][..t.root_count as usize];
    roots.iter().map(|&root| node(root)).collect()
}

/// Memory for the binary tree; what is in it does not matter.
#[derive(Debug, Default)]
pub(super) struct Room {
    children: Vec<[Node; 2]>,
    spans: Vec<Span>,
}

#[cfg(test)]
impl Room {
    pub(super) fn spoil(&mut self) {
        self.children.fill([Node::MAX; 2]);
        self.spans.fill([u32::MAX; 2]);
    }
}

/// The binary tree that treelets hold.
struct Binary<'a> {
    triangles: &'a [u32],
    /// Of each inner node, by its number.
    children: &'a mut [[Node; 2]],
    /// Likewise.
    spans: &'a mut [Span],
    root: Node,
}

/// A child of a wide node: what it stands for, and the row of its box.
#[derive(Clone, Copy)]
struct Lane {
    node: Node,
    row: u32,
    span: Span,
}

impl Lane {
    fn is_block(&self) -> bool {
        self.span[1] <= WideTree::LANES as u32
    }

    fn block(&self) -> u32 {
        let [first, count] = self.span;
        WideTree::BLOCK | goal(first, count)
    }
}

impl<'a> Binary<'a> {
    fn of(tree: &'a Treelets, room: &'a mut Room) -> Self {
        // Every entry is written below, so none is cleared.
        room.children.resize(tree.inner_count(), [0; 2]);
        room.spans.resize(tree.inner_count(), [0; 2]);
        let mut binary = Self {
            triangles: tree.depth_first_triangles(),
            children: &mut room.children,
            spans: &mut room.spans,
            root: 0,
        };
        let (mut first_row, mut below) = (0, Vec::new());
        for level in tree.levels() {
            let treelets: Vec<_> = level.clone().map(|t| tree.treelet(t as usize)).collect();
            below = binary.read_level(tree, &treelets, (first_row, &below));
            first_row = treelets[0].root_row;
        }
        binary.root = below[0];
        binary
    }

    /// Reads a level's inner nodes, a treelet a task; returns its roots. Those that it stands on are in rows from `first_row` on.
    fn read_level(
        &mut self,
        tree: &Treelets,
        treelets: &[Treelet],
        (first_row, below): (u32, &[Node]),
    ) -> Vec<Node> {
        // Levels are numbered from the triangles up.
        let first = (treelets[0].inner_row / 4 - 1) as usize;
        let (lower, mut spans) = self.spans.split_at_mut(first);
        let mut children = &mut self.children[first..];
        let mut tasks = Vec::with_capacity(treelets.len());
        for t in treelets {
            let own = (
                children.split_off_mut(..t.inner_count as usize),
                spans.split_off_mut(..t.inner_count as usize),
            );
            let place = (t.first_leaf.wrapping_sub(first_row) / 2) as usize;
            tasks.push((t, below.get(place..).unwrap_or_default(), own));
        }
        let lower = &*lower;
        let read = |(t, below, (children, spans)): (_, _, (Option<_>, Option<_>))| {
            let (children, spans) = (children.unwrap_or_default(), spans.unwrap_or_default());
            read_treelet(tree, t, below, lower, children, spans)
        };
        let roots: Vec<_> = tasks.into_par_iter().map(read).collect();
        roots.concat()
    }

    fn span(&self, node: Node) -> Span {
        if node & LEAF == 0 {
            self.spans[node as usize]
        } else {
            span_of_leaf(self.triangles, node)
        }
    }

    fn lane(&self, node: Node, row: u32) -> Lane {
        let span = self.span(node);
        Lane { node, row, span }
    }

    /// The children of an inner node.
    fn open(&self, node: Node) -> [Lane; 2] {
        let row = 4 * (node + 1);
        let [left, right] = self.children[node as usize];
        [self.lane(left, row), self.lane(right, row + 2)]
    }

    /// The subtrees that stand for an inner node: the largest is opened first.
    fn open_wide(&self, node: Node) -> Vec<Lane> {
        let mut lanes = Vec::with_capacity(WideTree::LANES);
        lanes.extend(self.open(node));
        while lanes.len() < WideTree::LANES {
            let large = lanes
                .iter()
                .enumerate()
                .filter(|(_, lane)| !lane.is_block());
            let Some((at, lane)) = large.max_by_key(|(_, lane)| lane.span[1]) else {
                break;
            };
            let [left, right] = self.open(lane.node);
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
    fn add_node(&mut self, lanes: &[Lane], next: &mut Vec<(Node, usize)>) -> u32 {
        let first = self.goals.len();
        for lane in lanes {
            self.rows.push(lane.row);
            if lane.is_block() {
                self.goals.push(lane.block());
            } else {
                next.push((lane.node, self.goals.len()));
                self.goals.push(0);
            }
        }
        goal(first as u32, lanes.len() as u32)
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
    /// Of treelets, in the rayon pool that the caller installed; `None` if they are of no triangle, of too many, or too deep.
    pub(super) fn of(tree: &Treelets, room: &mut Room) -> Option<Self> {
        if !(1..=Self::MOST_TRIANGLES).contains(&tree.leaf_count()) {
            return None;
        }
        let tree = Binary::of(tree, room);
        let mut lanes = Lanes::default();
        // Rows 0 and 1 are the box of all.
        let all = tree.lane(tree.root, 0);
        if all.is_block() {
            lanes.add_node(&[all], &mut Vec::new());
            return Some(lanes.into_tree(goal(0, 1)));
        }
        let mut level = Vec::new();
        let root = lanes.add_node(&tree.open_wide(tree.root), &mut level);
        for _ in 1..Self::MOST_LEVELS {
            let opened = level.par_iter().with_min_len(RUN);
            let opened: Vec<_> = opened.map(|&(node, _)| tree.open_wide(node)).collect();
            let mut next = Vec::new();
            for (&(_, lane), children) in level.iter().zip(&opened) {
                lanes.goals[lane] = lanes.add_node(children, &mut next);
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
        let (mut levels, lanes) = (0, wide.lanes);
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
            let treelets = Treelets::of_tree(&tree);
            let Some(wide) = treelets.wide() else {
                assert_eq!(treelets.leaf_count(), 0);
                continue;
            };
            let mut found = Vec::new();
            assert!(below(wide, wide.root, &mut found) <= WideTree::MOST_LEVELS);
            found.sort_unstable();
            assert!(found.into_iter().eq(0..treelets.leaf_count() as u32));
            let mut rows = wide.words[..wide.lanes].to_vec();
            rows.sort_unstable();
            rows.dedup();
            assert_eq!(rows.len(), wide.lanes, "a row twice");
            assert!(
                rows.iter()
                    .all(|&r| r % 2 == 0 && (r as usize) < treelets.rows())
            );
        }
    }

    #[test]
    fn lanes_lead_where_their_boxes_belong() {
        let tree = random_tree(5000, 2);
        let treelets = Treelets::of_tree(&tree);
        let wide = treelets.wide().expect("a wide tree");
        let mut room = Room::default();
        let binary = Binary::of(&treelets, &mut room);
        for lane in 0..wide.lanes {
            let row = wide.words[lane];
            let [left, right] = binary.children[(row / 4 - 1) as usize];
            let node = if row.is_multiple_of(4) { left } else { right };
            let goal = wide.words[wide.lanes + lane];
            if goal & WideTree::BLOCK != 0 {
                assert_eq!(goal, binary.lane(node, row).block());
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
        let of = |n| Treelets::of_tree(&random_tree(n, 1)).wide().is_some();
        assert!(of(1) && of(most) && !of(most + 1) && !of(0));
    }
}
