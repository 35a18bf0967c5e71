//! The layout `fast`: nodes of eight boxes over blocks of eight triangles, tested eight at a time.
//!
//! The adopted binary tree is collapsed: a subtree of at most eight triangles becomes a
//! *block*, whose triangles are tested together; above it, nodes take up to eight subtrees each
//! (Wald, Benthin, Boulos 2008). Boxes of single triangles are not kept: whoever needs one has its
//! corners at hand. What a hit is does not change, nor does one bit of it.

mod alone;
mod bundle;
mod cell;
mod few;
mod fit;
mod fold;
mod found;
mod jobs;
mod leaf;
mod light;
mod moving;
mod neighbours;
mod packet;
mod pass;
mod search;
mod single;
#[cfg(test)]
mod tests;
mod together;
mod trace;
mod tree;
mod trust;
mod visit;
mod walk;
#[cfg(test)]
mod walk_tests;

pub(crate) use trace::WideTracer;
pub(crate) use tree::Wide;
pub(crate) use walk::Stack;
