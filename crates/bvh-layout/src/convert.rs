//! Depth-first tree to breadth-first record.

use crate::Topology;
use bvh_build::BinaryTree;

/// Converts trees; keeps its memory between calls.
#[derive(Debug, Default)]
pub struct Converter {}

impl Converter {
    /// A converter that holds no memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The record of `tree`, for a scene of `triangle_count` triangles. `reuse`
    /// is an old record's memory (see [`Topology::into_words`]) or an empty vector.
    #[must_use]
    pub fn convert(
        &mut self,
        _tree: &BinaryTree,
        _triangle_count: usize,
        _reuse: Vec<u32>,
    ) -> Topology {
        unimplemented!()
    }
}
