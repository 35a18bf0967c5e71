//! Neighbouring subtrees of the binary tree, and what becomes of them.

use super::{First, LANES, Ranges};
use crate::{NodeRank, NodeRanks};

/// Neighbouring subtrees that together make one node or block.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Opened {
    lanes: [NodeRank; LANES],
    pub(super) count: usize,
    /// First lane and end of each binary node opened; one less than lanes.
    ranges: [[u8; 2]; LANES - 1],
}

impl Opened {
    fn of(root: NodeRank) -> Self {
        let mut opened = Self::default();
        opened.lanes[0] = root;
        opened.count = 1;
        opened
    }

    /// Puts the children of the inner node in `lane` in its place.
    fn open(&mut self, lane: usize, [left, right]: [NodeRank; 2]) {
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

    pub(super) fn lanes(&self) -> &[NodeRank] {
        &self.lanes[..self.count]
    }
}

/// A binary record with the size of each subtree.
#[derive(Clone, Copy)]
pub(super) struct SizedTree<'a> {
    pub(super) ranks: NodeRanks<'a>,
    pub(super) sizes: &'a [u32],
    /// Half areas of inner nodes, if boxes are known.
    pub(super) areas: Option<&'a [f32]>,
    /// Which of two children is asked first.
    pub(super) first: First,
}

impl SizedTree<'_> {
    /// Leaves below.
    #[inline]
    pub(super) fn size(&self, node: NodeRank) -> u32 {
        match node.leaf() {
            Some(_) => 1,
            None => self.sizes[node.rank() as usize],
        }
    }

    /// The subtrees of one node: the largest is opened until there are enough.
    pub(super) fn open_node(&self, root: NodeRank) -> Opened {
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
    fn first_last(&self, inner: NodeRank) -> [NodeRank; 2] {
        let [left, right] = self.ranks.children(inner);
        // A leaf's area is not at hand: none is less than any.
        match self.first == First::Larger && self.area(left) < self.area(right) {
            true => [left, right],
            false => [right, left],
        }
    }

    fn area(&self, node: NodeRank) -> Option<f32> {
        let areas = self.areas?;
        node.leaf().is_none().then(|| areas[node.rank() as usize])
    }

    /// What subtrees are compared by: their area, else their leaves.
    fn extent(&self, node: NodeRank) -> f32 {
        match (self.areas, node.leaf()) {
            (Some(areas), None) => areas[node.rank() as usize],
            _ => self.size(node) as f32,
        }
    }

    /// The leaves of one block.
    pub(super) fn open_block(&self, root: NodeRank) -> Opened {
        let mut opened = Opened::of(root);
        let mut lane = 0;
        while lane < opened.count {
            if opened.lanes[lane].leaf().is_some() {
                lane += 1;
            } else {
                opened.open(lane, self.ranks.children(opened.lanes[lane]));
            }
        }
        opened
    }
}
