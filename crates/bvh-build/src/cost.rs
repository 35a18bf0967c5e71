//! The surface area heuristic's cost of a tree.

use crate::{BinaryTree, Boxes};

/// Expected steps of a random ray that meets the root: traversal 1, intersection 1.
///
/// Sum of all nodes' areas over the root's (MacDonald, Booth 1990). 0 for a
/// tree whose root has no area or no triangle.
#[must_use]
pub fn sah_cost<B: Boxes + ?Sized>(_tree: &BinaryTree, _boxes: &B) -> f64 {
    unimplemented!()
}
