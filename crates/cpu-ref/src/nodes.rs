//! How the tree lies in memory: pairs of siblings, breadth first.

use bvh_layout::{Lists, Topology};
use geom::Aabb;
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::Range;

/// Two siblings: boxes and links of both, one cache line.
///
/// Node `i` of the record lies in slot `i + 1`: pair `slot / 2`, lane `slot % 2`.
/// So the children of the `k`-th inner node are pair `k + 1`, and pair 0 holds
/// the root in lane 1, beside an empty box that no ray meets.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Pair {
    /// For each axis: lower planes of lanes 0 and 1, then upper planes.
    pub(crate) planes: [[f32; 4]; 3],
    /// Where each lane leads.
    pub(crate) links: [Link; 2],
}

/// The pair of a node's children, or (flagged) the rank of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link(u32);

impl Link {
    /// The pair that holds the root.
    pub(crate) const ROOT: Self = Self(0);
    const LEAF: u32 = 1 << 31;

    fn leaf(rank: u32) -> Self {
        Self(rank | Self::LEAF)
    }

    /// Whether it names a leaf.
    #[inline]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The leaf's rank or the children's pair.
    #[inline]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

impl Pair {
    const EMPTY: Self = Self {
        planes: [[
            f32::INFINITY,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NEG_INFINITY,
        ]; 3],
        links: [Link::ROOT; 2],
    };

    /// The box of one lane.
    #[inline]
    pub(crate) fn bounds(&self, lane: usize) -> Aabb {
        Aabb {
            min: self.planes.map(|p| p[lane]),
            max: self.planes.map(|p| p[lane + 2]),
        }
    }

    /// Sets the box of one lane to the one between two corners.
    #[inline]
    pub(crate) fn set_bounds(&mut self, lane: usize, min: Vec3A, max: Vec3A) {
        for (axis, planes) in self.planes.iter_mut().enumerate() {
            planes[lane] = min[axis];
            planes[lane + 2] = max[axis];
        }
    }

    /// Corners of the least box that holds both lanes.
    #[inline]
    pub(crate) fn union(&self) -> [Vec3A; 2] {
        let corner = |lane: usize| Vec3A::from_array(self.planes.map(|p| p[lane]));
        [corner(0).min(corner(1)), corner(2).max(corner(3))]
    }
}

/// A leaf, as `preprocess` walks them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Leaf {
    /// Where its box lies.
    pub(crate) slot: u32,
    /// Its triangle's vertices.
    pub(crate) vertices: [u32; 3],
}

/// A tree's links, levels and boxes.
#[derive(Debug)]
pub(crate) struct Nodes {
    /// Pair 0 holds the root; there is always one.
    pub(crate) pairs: Vec<Pair>,
    /// The triangle of each leaf, by rank.
    pub(crate) triangles: Vec<u32>,
    /// All leaves, by rank.
    pub(crate) leaves: Vec<Leaf>,
    /// Pairs of each level, root first; none if the tree is empty.
    pub(crate) levels: Vec<Range<usize>>,
    /// Leaves before each run of [`Nodes::RUN`] pairs.
    first_leaves: Vec<u32>,
    /// The record's lists; kept for their memory.
    lists: Lists,
}

impl Default for Nodes {
    fn default() -> Self {
        Self {
            pairs: vec![Pair::EMPTY],
            triangles: Vec::new(),
            leaves: Vec::new(),
            levels: Vec::new(),
            first_leaves: vec![0],
            lists: Lists::default(),
        }
    }
}

impl Nodes {
    /// Pairs that one task handles.
    pub(crate) const RUN: usize = 1024;

    /// Takes over a record's shape, in parallel, reusing memory. Boxes are left as they are: stale.
    ///
    /// `triangles` are the scene's, three vertices each.
    pub(crate) fn expand(&mut self, tree: &Topology, triangles: &[[u32; 3]]) {
        self.levels.clear();
        self.levels.extend(tree.levels().map(|level| {
            let [start, end] = [level.nodes.start, level.nodes.end].map(|n| n as usize);
            start.div_ceil(2)..end.div_ceil(2)
        }));
        let nodes = LeafRanks::of(tree);
        let count = tree.node_count().div_ceil(2).max(1);
        self.pairs.resize(count, Pair::EMPTY);
        self.pairs
            .par_iter_mut()
            .enumerate()
            .with_min_len(Self::RUN)
            .for_each(|(p, pair)| pair.links = [0, 1].map(|lane| nodes.link(2 * p + lane)));
        self.pairs[0] = Pair {
            links: self.pairs[0].links,
            ..Pair::EMPTY
        };
        self.first_leaves.clear();
        let runs = (0..count).step_by(Self::RUN);
        self.first_leaves
            .extend(runs.map(|p| nodes.leaves_before((2 * p).saturating_sub(1))));
        self.list_leaves(tree, triangles);
    }

    fn list_leaves(&mut self, tree: &Topology, triangles: &[[u32; 3]]) {
        self.triangles.clear();
        self.triangles.extend_from_slice(tree.leaf_triangles());
        self.lists.fill(tree);
        self.lists
            .leaf_nodes
            .par_iter()
            .zip(&self.triangles)
            .with_min_len(Self::RUN)
            .map(|(&node, &triangle)| Leaf {
                slot: node + 1,
                vertices: triangles[triangle as usize],
            })
            .collect_into_vec(&mut self.leaves);
    }

    /// Leaves that lie before a pair, which must begin a run.
    pub(crate) fn leaves_before(&self, pair: usize) -> usize {
        debug_assert_eq!(pair % Self::RUN, 0);
        self.first_leaves[pair / Self::RUN] as usize
    }

    /// The box of the whole tree, in scaled units.
    pub(crate) fn root(&self) -> Aabb {
        self.pairs[0].bounds(1)
    }

    /// Boxes in node order, in scaled units.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = Aabb> + '_ {
        let nodes = (2 * self.triangles.len()).saturating_sub(1);
        (1..=nodes).map(|slot| self.pairs[slot / 2].bounds(slot % 2))
    }
}

/// Which nodes are leaves, and how many lie before.
struct LeafRanks<'a> {
    bits: &'a [u32],
    ranks: &'a [u32],
    nodes: usize,
}

impl<'a> LeafRanks<'a> {
    fn of(tree: &'a Topology) -> Self {
        Self {
            bits: tree.leaf_bits(),
            ranks: tree.leaf_ranks(),
            nodes: tree.node_count(),
        }
    }

    /// Leaves before `node`, which exists unless it is 0.
    fn leaves_before(&self, node: usize) -> u32 {
        let (word, bit) = (node / 32, node % 32);
        let below = |w: &u32| (w & ((1 << bit) - 1)).count_ones();
        self.ranks
            .get(word)
            .map_or(0, |r| r + below(&self.bits[word]))
    }

    fn link(&self, slot: usize) -> Link {
        let Some(node) = slot.checked_sub(1).filter(|&n| n < self.nodes) else {
            return Link::ROOT;
        };
        let rank = self.leaves_before(node);
        if self.bits[node / 32] >> (node % 32) & 1 == 1 {
            Link::leaf(rank)
        } else {
            Link(node as u32 - rank + 1)
        }
    }
}
