//! Ray-triangle tests in single precision. Triangles are prepared once per moment. The watertight test also prepares
//! each ray once.

mod moller_trumbore;
mod triangle_data;
mod watertight;
mod woop;

pub use moller_trumbore::MollerTrumbore;
pub use triangle_data::{TriangleData, TriangleHit};
pub use watertight::{Watertight, has_equal_signs};
pub use woop::Woop;

pub(crate) use watertight::solve;

use crate::scale::PreparedRay;
use backend::Intersector;
use geom::Triangle;

/// Preprocesses an active, non-degenerate triangle, given in scaled units.
#[inline]
pub fn preprocess(intersector: Intersector, corners: &Triangle) -> TriangleData {
    match intersector {
        Intersector::MollerTrumbore => MollerTrumbore::preprocess(corners),
        Intersector::Woop => Woop::preprocess(corners),
        // The filter of `exact` uses the intermediate results of the watertight test.
        Intersector::Watertight | Intersector::Exact => Watertight::preprocess(corners),
    }
}

/// A test, with the data that it precomputes for one ray.
pub(crate) enum SinglePrecisionTest {
    MollerTrumbore,
    Woop,
    Watertight(Watertight),
}

impl SinglePrecisionTest {
    pub(crate) fn new(intersector: Intersector, ray: &PreparedRay) -> Self {
        match intersector {
            Intersector::MollerTrumbore => Self::MollerTrumbore,
            Intersector::Woop => Self::Woop,
            Intersector::Watertight | Intersector::Exact => Self::Watertight(Watertight::new(ray)),
        }
    }

    /// Intersects the whole line of `ray`, for which the test was created, with a triangle. The caller clamps `t` and
    /// applies the limits.
    #[inline]
    pub(crate) fn intersect(
        &self,
        ray: &PreparedRay,
        triangle: &TriangleData,
    ) -> Option<TriangleHit> {
        match self {
            Self::MollerTrumbore => MollerTrumbore::intersect(ray, triangle),
            Self::Woop => Woop::intersect(ray, triangle),
            Self::Watertight(sheared_ray) => sheared_ray.intersect(triangle),
        }
    }
}
