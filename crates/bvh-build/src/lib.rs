//! Builds binary trees over boxes by the binned surface area heuristic.
//!
//! The method is that of Wald (*On fast Construction of SAH-based Bounding Volume Hierarchies*, 2007), down to exactly
//! one triangle per leaf. The tree depends on the boxes, the block size and the point that children are ordered toward,
//! not on the number of threads. Its depth is at most [`MAX_DEPTH`] for any input. Parallel work runs in the rayon pool
//! that the caller installed.
//!
//! [`SahBuilder`] builds from boxes alone, [`SubtreeRebuilder`] from an earlier tree.
//!
//! `prim` and `tree` define the input and the output, `bins` finds planes, and `task` holds the parameters of a build.
//! `node` divides large nodes, then `small` and `tiny` build the subtrees below. `builder` and `subtrees` are the
//! entry points.

mod bins;
mod builder;
mod cancel;
mod cost;
mod gather;
mod node;
mod occluder_first;
mod prim;
mod small;
mod subtrees;
mod task;
mod tiny;
mod tree;

pub use bins::BlockSize;
pub use builder::SahBuilder;
pub use cancel::{BuildError, Cancel};
pub use cost::sah_cost;
pub use gather::{AnimationBoxes, Boxes};
pub use subtrees::{SubtreeRebuilder, TreeCosts};
pub use tree::{BinaryTree, Subtree};

/// Runs both closures, in parallel if the work is large, and returns both results.
#[inline]
fn join_if<A: Send, B: Send>(
    is_large: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if is_large {
        rayon::join(a, b)
    } else {
        (a(), b())
    }
}

/// Maximum depth of a leaf, where the root has depth 0. A traversal that pushes one
/// child and continues with the other needs a stack of this many entries. One that pushes both needs one more.
pub const MAX_DEPTH: u32 = 64;
