//! Converts binary trees to the forms that backends read, without boxes.
//!
//! A [`Topology`] is a binary tree of a scene. It may also contain the same tree as [`Treelets`], for devices that refit
//! in workgroup memory, and as a [`BlockTree`], for processors that test eight boxes at once. Boxes are left out, because
//! the backend recomputes them by a refit, as in Kim, Kim, Lee, Han (2014).

mod blocks;
mod moving;
#[cfg(test)]
mod tests;
mod topology;
mod treelets;

pub use blocks::{
    Block, BlockTree, BlockTreeNode, CollapseOptions, FirstVisited, LANES, Link, Ranges,
};
pub use moving::Moving;
pub use topology::{Converter, Topology};
pub use treelets::{Treelet, Treelets, WideTree};
