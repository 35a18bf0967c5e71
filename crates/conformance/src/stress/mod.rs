//! How often each intersector is wrong where arithmetic is hardest.
//!
//! A [`Family`] makes scenes and rays that are hard in one way. A [`StressTest`] asks them of a backend and counts what differs
//! from the [exact answer](crate::oracle); on closed bodies also leaks and double hits. Robust intersectors may have none, of
//! others what was measured is expected ([`baseline`]), with slack for chance. A rate above its bound is a fault; so is one
//! below, for then something is not what it is called.
//!
//! An [`audit::Audit`] asks rays by the million of scenes of all kinds, of which `exact` may get none wrong.

pub mod audit;
pub mod baseline;
mod cell;
mod scenes;
mod stress_test;

pub use cell::{Cell, Measure, Measured};
pub use stress_test::StressTest;

/// What to ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Decides scenes and rays.
    pub seed: u64,
    /// Rays of each family.
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
        /// Triangles of no area, and others that hardly have any, among sound ones.
        ZeroArea = "zero-area",
        /// Coordinates from `1e15` to `3e37`.
        Huge = "huge",
        /// Coordinates from `1e-12` to `1e-35`.
        Tiny = "tiny",
        /// Coordinates that are subnormal.
        Subnormal = "subnormal",
        /// Closed bodies of size 1, 10 from the origin on each axis.
        Far10 = "far-10",
        /// Likewise, a thousand.
        Far1e3 = "far-1e3",
        /// Likewise, a hundred thousand.
        Far1e5 = "far-1e5",
        /// Likewise, ten million: coordinates are whole numbers there, and bodies no longer closed to the eye.
        Far1e7 = "far-1e7",
        /// Equal triangles, turned, reversed, and coplanar ones that overlap.
        Stacks = "stacks",
        /// Rays at edges of closed bodies.
        Edges = "edges",
        /// Rays at vertices of closed bodies.
        Vertices = "vertices",
        /// Rays in the plane of a triangle, towards it.
        InPlane = "in-plane",
        /// Rays that start on a triangle.
        OnSurface = "on-surface",
        /// Rays along an axis, at insides, edges and vertices.
        AxisParallel = "axis-parallel",
        /// Moments between key frames of which one is a million times as large as the other.
        ExtremeKeys = "extreme-keys",
        /// A cloth wrung as tight as it gets.
        FoldingCloth = "folding-cloth",
        /// Coordinates and directions that are zeros of either sign.
        SignedZeros = "signed-zeros",
        /// Vertices that are not finite, always or at times.
        NonFinite = "non-finite",
        /// Closed bodies of size 1 beside one triangle between `1e3` and `3e38` away, or between `1e-3` and `1e-38` large.
        Outlier = "outlier",
        /// A sheet, one vertex of which goes so far in a later key frame.
        Exploding = "exploding",
    }
}
