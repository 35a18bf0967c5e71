//! Converts a binary tree to a breadth-first record of its topology, without boxes.
//!
//! This is the conversion of Kim, Kim, Lee, Han (2014): nodes level by level. Each level lists its leaves and inner
//! nodes together. Boxes are left out, because the backend recomputes them by a refit. Siblings are neighbours, so the
//! children of the `k`-th inner node are nodes `2k + 1` and `2k + 2`. One bit per node (leaf or not) and a rank
//! directory (Jacobson 1989) encode the shape in about 0.5 bytes per triangle. With the triangle index of each leaf, a
//! record takes 4.5 bytes per triangle. Nodes with boxes take 64.
//!
//! A record may also carry the same tree as [`Treelets`], for devices that refit in workgroup memory, and as a
//! [`BlockTree`], for processors that test eight boxes at once.

mod blocks;
mod convert;
mod moving;
mod record;
#[cfg(test)]
mod tests;
mod treelets;
mod validate;
mod walk;

pub use blocks::{Block, BlockTree, CollapseOptions, First, LANES, Link, Ranges, WideNode};
pub use convert::{Converter, Spare};
pub use moving::Moving;
pub use record::{NodeRank, NodeRanks, Topology};
pub use treelets::{Treelet, Treelets, WideTree};
pub use validate::TopologyError;
