//! Binary tree in, breadth-first record out, without boxes.
//!
//! The paper's conversion (Kim, Kim, Lee, Han 2014): nodes level by level, a list of leaves and a list of inner nodes
//! for each level, and no boxes, since whoever adopts the record recomputes them by a refit. Siblings are neighbours,
//! so the children of the `k`-th inner node are nodes `2k + 1` and `2k + 2`, and one bit a node (leaf or not) with a
//! rank directory (Jacobson 1989) holds all of it: about 4.5 bytes a triangle, where nodes with boxes take 64.
//!
//! A record may carry the same tree as [`Treelets`] too, for devices that refit
//! it in the memory of workgroups, and as a [`BlockTree`] for machines that test eight boxes at once.

mod blocks;
mod convert;
mod moving;
mod record;
#[cfg(test)]
mod tests;
mod treelets;
mod validate;
mod walk;

pub use blocks::{Block, BlockTree, First, LANES, Link, Ranges, WideNode};
pub use convert::{Converter, Spare};
pub use moving::Moving;
pub use record::{NodeRank, NodeRanks, Topology};
pub use treelets::{Treelet, Treelets, WideTree};
pub use validate::RecordError;
