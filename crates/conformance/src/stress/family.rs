//! What makes arithmetic hard.

use std::fmt;

/// One way in which scenes and rays are hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Family {
    /// Triangles a thousand to ten million times as long as wide.
    Needles,
    /// Triangles of no area, and others that hardly have any, among sound ones.
    ZeroArea,
    /// Coordinates from `1e15` to `3e37`.
    Huge,
    /// Coordinates from `1e-12` to `1e-35`.
    Tiny,
    /// Coordinates that are subnormal.
    Subnormal,
    /// Closed bodies of size 1, 10 from the origin on each axis.
    Far10,
    /// Likewise, a thousand.
    Far1e3,
    /// Likewise, a hundred thousand.
    Far1e5,
    /// Likewise, ten million: coordinates are whole numbers there, and bodies no longer closed to the eye.
    Far1e7,
    /// Equal triangles, turned, reversed, and coplanar ones that overlap.
    Stacks,
    /// Rays at edges of closed bodies.
    Edges,
    /// Rays at vertices of closed bodies.
    Vertices,
    /// Rays in the plane of a triangle, towards it.
    InPlane,
    /// Rays that start on a triangle.
    OnSurface,
    /// Rays along an axis, at insides, edges and vertices.
    AxisParallel,
    /// Moments between key frames of which one is a million times as large as the other.
    ExtremeKeys,
    /// A cloth wrung as tight as it gets.
    FoldingCloth,
    /// A tree refitted after every triangle went elsewhere.
    Rearranged,
    /// Coordinates and directions that are zeros of either sign.
    SignedZeros,
    /// Vertices that are not finite, always or at times.
    NonFinite,
    /// Closed bodies of size 1 beside one triangle between `1e3` and `3e38` away, or between `1e-3` and `1e-38` large.
    Outlier,
    /// A sheet, one vertex of which goes so far in a later key frame.
    Exploding,
}

impl Family {
    /// All there are.
    pub const ALL: [Self; 22] = [
        Self::Needles,
        Self::ZeroArea,
        Self::Huge,
        Self::Tiny,
        Self::Subnormal,
        Self::Far10,
        Self::Far1e3,
        Self::Far1e5,
        Self::Far1e7,
        Self::Stacks,
        Self::Edges,
        Self::Vertices,
        Self::InPlane,
        Self::OnSurface,
        Self::AxisParallel,
        Self::ExtremeKeys,
        Self::FoldingCloth,
        Self::Rearranged,
        Self::SignedZeros,
        Self::NonFinite,
        Self::Outlier,
        Self::Exploding,
    ];

    /// Its name in tables and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Needles => "needles",
            Self::ZeroArea => "zero-area",
            Self::Huge => "huge",
            Self::Tiny => "tiny",
            Self::Subnormal => "subnormal",
            Self::Far10 => "far-10",
            Self::Far1e3 => "far-1e3",
            Self::Far1e5 => "far-1e5",
            Self::Far1e7 => "far-1e7",
            Self::Stacks => "stacks",
            Self::Edges => "edges",
            Self::Vertices => "vertices",
            Self::InPlane => "in-plane",
            Self::OnSurface => "on-surface",
            Self::AxisParallel => "axis-parallel",
            Self::ExtremeKeys => "extreme-keys",
            Self::FoldingCloth => "folding-cloth",
            Self::Rearranged => "rearranged",
            Self::SignedZeros => "signed-zeros",
            Self::NonFinite => "non-finite",
            Self::Outlier => "outlier",
            Self::Exploding => "exploding",
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
