//! The builder: a reusable workspace round the recursion.

use crate::{BinaryTree, Boxes, Cancel};

/// Why there is no tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BuildError {
    /// Somebody asked the build to stop.
    #[error("the build was cancelled")]
    Cancelled,
}

/// Builds trees; keeps its memory, so that a second build of the same size allocates nothing large.
#[derive(Debug, Default)]
pub struct Builder {}

impl Builder {
    /// A builder that holds no memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds over all boxes that are not empty, into `tree`, whose memory is reused.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`]; `tree` is then empty.
    pub fn build<B: Boxes + ?Sized>(
        &mut self,
        _boxes: &B,
        _cancel: &Cancel,
        _tree: &mut BinaryTree,
    ) -> Result<(), BuildError> {
        unimplemented!()
    }
}
