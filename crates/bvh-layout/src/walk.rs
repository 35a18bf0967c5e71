//! A preorder walk over a binary tree's inner nodes that streams and can start anywhere.

use bvh_build::{BinaryTree, MAX_DEPTH};

/// An inner node whose turn has not come.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    first_leaf: u32,
    leaves: u32,
    depth: u32,
}

/// An inner node as the walk meets it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inner {
    pub(crate) depth: u32,
    /// First leaf of the left child.
    pub(crate) left: u32,
    /// First leaf of the right child.
    pub(crate) right: u32,
    /// Bit 0: the left child is a leaf; bit 1: the right child is.
    pub(crate) leaf_children: u8,
}

/// A power of two above `MAX_DEPTH`, so that masked indices need no check: at most one node waits for each depth.
const STACK: usize = 128;

/// Inner nodes that wait, the next one on top. Nothing branches on the tree's shape.
#[derive(Debug)]
pub(crate) struct Walk {
    stack: [Pending; STACK],
    waiting: usize,
}

impl Walk {
    /// A walk that meets the inner node `start` (in preorder) first.
    pub(crate) fn starting_at(tree: &BinaryTree, start: usize) -> Self {
        let mut walk = Self {
            stack: [Pending::default(); STACK],
            waiting: 0,
        };
        let leaves = tree.leaf_count() as u32;
        walk.push(Pending {
            leaves,
            ..Pending::default()
        });
        let mut at = 0;
        while at < start {
            let node = walk.pop();
            let left = tree.left_leaves()[at];
            let [left_child, right_child] = node.children(left);
            walk.push(right_child);
            if at + (left as usize) <= start {
                at += left as usize;
            } else {
                walk.push(left_child);
                at += 1;
            }
        }
        walk
    }

    /// Meets the next inner nodes, one for each entry of `left_leaves`. Panics if the tree is deeper than [`MAX_DEPTH`].
    #[inline(always)]
    pub(crate) fn run(mut self, left_leaves: &[u32], mut meet: impl FnMut(Inner)) {
        for &left in left_leaves {
            let node = self.pop();
            assert!(node.depth < MAX_DEPTH, "a leaf lies deeper than MAX_DEPTH");
            let [left_child, right_child] = node.children(left);
            self.push(right_child);
            self.push(left_child);
            meet(Inner {
                depth: node.depth,
                left: left_child.first_leaf,
                right: right_child.first_leaf,
                leaf_children: u8::from(left_child.leaves == 1)
                    | u8::from(right_child.leaves == 1) << 1,
            });
        }
    }

    /// Leaves do not wait: they are overwritten by whoever comes next.
    #[inline(always)]
    fn push(&mut self, node: Pending) {
        self.stack[self.waiting % STACK] = node;
        self.waiting += usize::from(node.leaves > 1);
    }

    #[inline(always)]
    fn pop(&mut self) -> Pending {
        self.waiting = self.waiting.wrapping_sub(1);
        self.stack[self.waiting % STACK]
    }
}

impl Pending {
    #[inline(always)]
    fn children(self, left_leaves: u32) -> [Self; 2] {
        let depth = self.depth + 1;
        [
            Self {
                leaves: left_leaves,
                depth,
                ..self
            },
            Self {
                first_leaf: self.first_leaf + left_leaves,
                leaves: self.leaves - left_leaves,
                depth,
            },
        ]
    }
}
