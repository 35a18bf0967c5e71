//! Statistics of a tracer.

/// State of the tree and of the scene after the last finished query.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// Number of the current tree, counted from 1. Trees that were requested but not adopted count, too.
    pub generation: u64,
    /// Number of submissions since the one that requested the current tree. Queries that are traced together share a
    /// submission.
    pub age: u64,
    /// Cost of the refitted tree by the surface area heuristic, relative to its cost when it was built. `None` if the
    /// backend does not measure costs, the root box has no area, or the areas overflow.
    pub cost_ratio: Option<f64>,
    /// Whether the next tree is being built, or is finished but not yet adopted.
    pub building: bool,
    /// Number of triangles with a vertex that is not finite. They are never hit.
    pub inactive: u64,
    /// Number of triangles without area. They are never hit.
    pub degenerate: u64,
}
