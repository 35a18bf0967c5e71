//! Queries of a step.

use backend::{QueryKind, Rays};
use geom::Camera;

/// Kind of result for each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any hit. This is faster, and sufficient for shadows and line of sight.
    Any,
}

impl Query {
    /// Returns the size in bytes of a result in device memory.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn result_bytes(self) -> usize {
        match self {
            Self::Closest => size_of::<geom::Hit>(),
            Self::Any => size_of::<u32>(),
        }
    }

    /// Returns the backend's query of this kind.
    pub(crate) fn of(self, rays: Rays<'_>) -> backend::Query<'_> {
        let kind = match self {
            Self::Closest => QueryKind::Closest,
            Self::Any => QueryKind::Any,
        };
        backend::Query { rays, kind }
    }
}

/// Identifies a submitted step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StepId(pub(crate) u64);

/// Identifies a query of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueryId {
    pub(crate) step: StepId,
    pub(crate) query: u32,
}

/// A query that is traced when the step ends.
#[derive(Debug)]
pub(crate) struct DeferredQuery {
    pub(crate) id: QueryId,
    pub(crate) rays: DeferredRays,
    pub(crate) kind: Query,
}

/// Rays that are read when the step ends.
#[derive(Debug)]
pub(crate) enum DeferredRays {
    Camera(Camera),
    /// No rays. Used for encoded steps without queries, and for queries of no rays.
    #[cfg(feature = "wgpu")]
    Empty,
    #[cfg(feature = "wgpu")]
    Wgpu {
        buffers: gpu_wgpu::LentRays<wgpu::Buffer>,
        count: usize,
    },
}

impl DeferredQuery {
    /// Returns the backend's query.
    pub(crate) fn query(&self) -> backend::Query<'_> {
        self.kind.of(match &self.rays {
            DeferredRays::Camera(camera) => Rays::Camera(camera),
            #[cfg(feature = "wgpu")]
            DeferredRays::Empty => Rays::List(&[]),
            #[cfg(feature = "wgpu")]
            DeferredRays::Wgpu { count, .. } => Rays::OnDevice(*count),
        })
    }
}
