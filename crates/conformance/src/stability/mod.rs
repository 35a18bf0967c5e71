//! Measures how often each intersector is wrong where arithmetic is hardest.
//!
//! A [`Family`] generates scenes and rays that are hard in one way. A [`StabilityTest`] traces them on a backend and
//! counts hits whose triangle differs from that of the [exact hit](crate::oracle). On closed bodies, except those
//! of `far-1e7`, it also counts leaks and double hits.
//!
//! `exact` must have zero counts, and `watertight` no leaks or double hits. All other rates must match the measured
//! ones ([`baseline`]), within chance. A rate above its bounds is a fault. A rate below them is a fault too, because
//! the backend then traces with another intersector.

pub mod baseline;
mod cell;
mod scenes;
mod stability_test;

pub use cell::{Measure, MeasuredRate, StabilityCell};
pub use stability_test::StabilityTest;

/// Parameters of a stability test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Seed of the scenes and rays.
    pub seed: u64,
    /// Number of rays per family.
    pub rays: u32,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            seed: 1,
            rays: 8192,
        }
    }
}

backend::named! {
    /// One way in which scenes and rays are hard.
    pub enum Family {
        /// Triangles a thousand to ten million times as long as wide.
        Needles = "needles",
        /// Triangles with zero or nearly zero area, among regular ones.
        ZeroArea = "zero-area",
        /// Coordinates from `1e15` to `3e37`.
        Huge = "huge",
        /// Coordinates from `1e-12` to `1e-35`.
        Tiny = "tiny",
        /// Subnormal coordinates.
        Subnormal = "subnormal",
        /// Closed bodies, moved by 10 along each axis.
        Far10 = "far-10",
        /// Closed bodies, moved by a thousand along each axis.
        Far1e3 = "far-1e3",
        /// Closed bodies, moved by a hundred thousand along each axis.
        Far1e5 = "far-1e5",
        /// Closed bodies, moved by ten million along each axis. Coordinates are integers there, and bodies are visibly
        /// deformed.
        Far1e7 = "far-1e7",
        /// Copies of triangles, some with rotated or reversed order of vertices, and coplanar triangles that overlap.
        Stacks = "stacks",
        /// Rays at edges of closed bodies.
        Edges = "edges",
        /// Rays at vertices of closed bodies.
        Vertices = "vertices",
        /// Rays in the plane of a triangle, towards it.
        InPlane = "in-plane",
        /// Rays that start on a triangle.
        OnSurface = "on-surface",
        /// Rays along an axis, at interiors, edges and vertices.
        AxisParallel = "axis-parallel",
        /// Moments between key frames whose sizes differ by a factor of a million.
        ExtremeKeys = "extreme-keys",
        /// A cloth twisted to its maximum.
        FoldingCloth = "folding-cloth",
        /// Coordinates, and half of the directions, contain many zeros of either sign.
        SignedZeros = "signed-zeros",
        /// Vertices that are not finite, in some or all key frames.
        NonFinite = "non-finite",
        /// Closed bodies and one triangle at a distance of `1e3` to `3e38`, or of size `1e-38` to `1e-3`.
        Outlier = "outlier",
        /// A sheet with one vertex that moves by `1e3` to `3e38` in the last key frame.
        Exploding = "exploding",
    }
}
