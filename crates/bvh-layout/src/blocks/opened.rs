//! Neighbouring subtrees of the binary tree, and what becomes of them.

use super::{First, LANES, Ranges};
use crate::Topology;

/// A binary node: the rank of a leaf (flagged) or of an inner node, among their kind.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Binary(pub(super) u32);

impl Binary {
    pub(super) const LEAF: u32 = 1 << 31;

    #[inline]
    pub(super) fn leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }
}

/// Neighbouring subtrees that together make one node or block.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Opened {
    lanes: [Binary; LANES],
    pub(super) count: usize,
    /// First lane and end of each binary node opened; one less than lanes.
    ranges: [[u8; 2]; LANES - 1],
}

impl Opened {
    fn of(root: Binary) -> Self {
        let mut opened = Self::default();
        opened.lanes[0] = root;
        opened.count = 1;
        opened
    }

    /// Puts the children of the inner node in `lane` in its place.
    fn open(&mut self, lane: usize, [left, right]: [Binary; 2]) {
        self.lanes.copy_within(lane + 1..self.count, lane + 2);
        self.lanes[lane] = left;
        self.lanes[lane + 1] = right;
        let lane = lane as u8;
        for [first, end] in &mut self.ranges[..self.count - 1] {
            *first += u8::from(*first > lane);
            *end += u8::from(*end > lane);
        }
        self.ranges[self.count - 1] = [lane, lane + 2];
        self.count += 1;
    }

    pub(super) fn ranges(&self) -> Ranges {
        let mut ranges = Ranges::NONE;
        for &[first, end] in &self.ranges[..self.count - 1] {
            ranges.push(first, end);
        }
        ranges
    }

    pub(super) fn lanes(&self) -> &[Binary] {
        &self.lanes[..self.count]
    }
}

/// A binary record with the size of each subtree.
#[derive(Clone, Copy)]
pub(super) struct SizedTree<'a> {
    pub(super) bits: &'a [u32],
    pub(super) ranks: &'a [u32],
    pub(super) sizes: &'a [u32],
    /// Half areas of inner nodes, if boxes are known.
    pub(super) areas: Option<&'a [f32]>,
    /// Which of two children is asked first.
    pub(super) first: First,
}

impl<'a> SizedTree<'a> {
    /// With no sizes and no areas.
    pub(super) fn of(tree: &'a Topology) -> Self {
        Self {
            bits: tree.leaf_bits(),
            ranks: tree.leaf_ranks(),
            sizes: &[],
            areas: None,
            first: First::Left,
        }
    }

    #[inline]
    pub(super) fn node(&self, node: u32) -> Binary {
        let (word, bit) = (node as usize / 32, node % 32);
        let before = self.ranks[word] + (self.bits[word] & ((1 << bit) - 1)).count_ones();
        if self.bits[word] >> bit & 1 == 1 {
            Binary(before | Binary::LEAF)
        } else {
            Binary(node - before)
        }
    }

    #[inline]
    pub(super) fn children(&self, inner: Binary) -> [Binary; 2] {
        Topology::children_of_inner(inner.0).map(|node| self.node(node))
    }

    /// Leaves below; `deeper` begins with inner node `first`.
    #[inline]
    pub(super) fn size_among(&self, node: Binary, deeper: &[u32], first: usize) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => deeper[node.0 as usize - first],
        }
    }

    #[inline]
    pub(super) fn size(&self, node: Binary) -> u32 {
        self.size_among(node, self.sizes, 0)
    }

    /// The subtrees of one node: the largest is opened until there are enough.
    pub(super) fn open_node(&self, root: Binary) -> Opened {
        let mut opened = Opened::of(root);
        while opened.count < LANES {
            let lanes = opened.lanes().iter().enumerate();
            let large = lanes.filter(|(_, node)| self.size(**node) as usize > LANES);
            let Some((largest, _)) =
                large.max_by(|a, b| self.extent(*a.1).total_cmp(&self.extent(*b.1)))
            else {
                break;
            };
            opened.open(largest, self.first_last(opened.lanes[largest]));
        }
        opened
    }

    /// The children of an inner node, that which is asked first in the later lane.
    fn first_last(&self, inner: Binary) -> [Binary; 2] {
        let [left, right] = self.children(inner);
        // A leaf's area is not at hand: none is less than any.
        match self.first == First::Larger && self.area(left) < self.area(right) {
            true => [left, right],
            false => [right, left],
        }
    }

    fn area(&self, node: Binary) -> Option<f32> {
        let areas = self.areas?;
        node.leaf().is_none().then(|| areas[node.0 as usize])
    }

    /// What subtrees are compared by: their area, else their leaves.
    fn extent(&self, node: Binary) -> f32 {
        match (self.areas, node.leaf()) {
            (Some(areas), None) => areas[node.0 as usize],
            _ => self.size(node) as f32,
        }
    }

    /// The leaves of one block.
    pub(super) fn open_block(&self, root: Binary) -> Opened {
        let mut opened = Opened::of(root);
        let mut lane = 0;
        while lane < opened.count {
            if opened.lanes[lane].leaf().is_some() {
                lane += 1;
            } else {
                opened.open(lane, self.children(opened.lanes[lane]));
            }
        }
        opened
    }
}
