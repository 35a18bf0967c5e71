//! Commands that may precede a frame, in any order that the contract of backends permits.

use super::strategies::shrinking_list;
use super::topologies::{LeafSplit, TreeDescription};
use bvh_layout::Topology;
use geom::Animation;
use proptest::prelude::*;
use std::sync::Arc;

#[derive(Clone, Copy, Debug)]
pub(crate) enum BackendCommand {
    /// Traces the case's rays and reads all results. Computes boxes first if they are stale.
    Frame,
    /// Interpolates at one of the case's first three times.
    Interpolate(usize),
    /// Preprocesses without refitting.
    Preprocess,
    /// Computes boxes: preprocesses and refits.
    Boxes,
    /// Submits the recorded commands.
    Submit,
    /// Requests a copy of the positions.
    Request,
    /// Adopts another tree.
    Adopt(AdoptedTree),
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum AdoptedTree {
    /// Built at one of the case's first three times, with treelets. Has lists of moving treelets if at most half move.
    Built(usize),
    /// Built at one of the case's first three times, without treelets.
    Plain(usize),
    /// Split at random, with treelets, and with lists as for `Built`. The number is the seed of leaf order and shape.
    Random(u64),
}

/// Number of commands per case. About every fifth is a frame.
const COMMANDS: usize = 28;

/// Lists of commands. Shrinking removes commands.
pub(crate) fn commands() -> impl Strategy<Value = Vec<BackendCommand>> {
    let time = || 0..3_usize;
    let tree = prop_oneof![
        time().prop_map(AdoptedTree::Built),
        time().prop_map(AdoptedTree::Plain),
        any::<u64>().prop_map(AdoptedTree::Random),
    ];
    let one = prop_oneof![
        4 => Just(BackendCommand::Frame),
        5 => time().prop_map(BackendCommand::Interpolate),
        2 => Just(BackendCommand::Preprocess),
        1 => Just(BackendCommand::Boxes),
        3 => Just(BackendCommand::Submit),
        2 => Just(BackendCommand::Request),
        2 => tree.prop_map(BackendCommand::Adopt),
    ];
    shrinking_list((0..COMMANDS).map(move |_| one.clone().no_shrink()))
}

impl AdoptedTree {
    /// Returns the tree. `built` builds a tree at the case's time of the given index.
    pub(crate) fn tree(self, animation: &Animation, built: impl Fn(usize) -> Topology) -> Topology {
        match self {
            Self::Built(time) => built(time),
            Self::Plain(time) => without_treelets(&built(time)),
            Self::Random(seed) => {
                let split = LeafSplit::Random;
                let tree = TreeDescription { split, seed }.tree(animation);
                tree.with_moving(animation.static_parts())
            }
        }
    }
}

/// Returns the same tree without treelets and lists of moving treelets.
pub(crate) fn without_treelets(tree: &Topology) -> Topology {
    Topology::new(Arc::clone(tree.binary()), tree.triangle_count())
}
