//! Vertices in, record out, in the rayon pool of whoever calls.

use bvh_build::{BinaryTree, BuildError, Builder, Cancel, sah_cost};
use bvh_layout::{Converter, Topology};
use geom::{Animation, Point};
use std::time::Instant;

/// A finished tree.
#[derive(Debug)]
pub struct Built {
    /// Its shape, as it is handed over.
    pub topology: Topology,
    /// Its cost at the vertices it was built from: see [`sah_cost`].
    pub cost: f64,
    /// Milliseconds from vertices to binary tree.
    pub build_ms: f64,
    /// Milliseconds from binary tree to record, and to lists of what moves.
    pub convert_ms: f64,
    /// When all of that was.
    pub moments: BuildMoments,
}

/// The stages of a build on the host's clock, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildMoments {
    /// The builder took up the vertices.
    pub begun: Instant,
    /// The binary tree stood.
    pub built: Instant,
    /// The record was written.
    pub converted: Instant,
    /// The cost was known, and the tree finished.
    pub ended: Instant,
}

/// The builder's tools and their memory, used again and again.
#[derive(Debug, Default)]
pub struct Workbench {
    builder: Builder,
    tree: BinaryTree,
    converter: Converter,
}

impl Workbench {
    /// No memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds and converts a tree over `animation` standing at `positions`.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub fn build(
        &mut self,
        animation: &Animation,
        positions: &[Point],
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let boxes = (animation, positions);
        let begun = Instant::now();
        self.builder.build(&boxes, cancel, &mut self.tree)?;
        let built = Instant::now();
        let topology = self
            .converter
            .convert(&self.tree, animation.triangle_count(), Vec::new())
            .with_moving(animation.static_parts());
        let converted = Instant::now();
        let cost = sah_cost(&self.tree, &boxes);
        Ok(Built {
            topology,
            cost,
            build_ms: (built - begun).as_secs_f64() * 1e3,
            convert_ms: (converted - built).as_secs_f64() * 1e3,
            moments: BuildMoments {
                begun,
                built,
                converted,
                ended: Instant::now(),
            },
        })
    }
}
