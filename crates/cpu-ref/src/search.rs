//! What it means to ask one ray, whatever the intersector.

use crate::extreme::Rule;
use crate::preprocess::Geometry;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::traverse::{Stack, Tree, any, closest};
use crate::triangle_test::TriangleTest;
use geom::{Hit, Ray};
use std::sync::atomic::AtomicU64;

/// A ray and all it can meet.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a, N> {
    /// Boxes and triangles.
    pub(crate) tree: N,
    /// Where triangles are.
    pub(crate) geometry: Geometry<'a>,
    /// The ray, in units of the scene divided by `scale`.
    pub(crate) ray: Ray,
    /// From the ray's units to scaled units.
    pub(crate) scale: Scale,
    /// Counts rays that exact arithmetic settled.
    pub(crate) settled: &'a AtomicU64,
}

/// An intersector as the tracer sees it.
pub(crate) trait Search<N> {
    /// How extreme rays are answered, if in exact arithmetic.
    const EXTREMES: Option<Rule>;

    /// The closest hit, `t` in the ray's own units.
    fn closest(asked: &Asked<'_, N>, stack: &mut Stack) -> Option<Hit>;

    /// Whether the ray hits any triangle but `skipped`.
    fn any(asked: &Asked<'_, N>, skipped: Option<u32>, stack: &mut Stack) -> bool;
}

impl<N: Tree, T: TriangleTest> Search<N> for T {
    const EXTREMES: Option<Rule> = T::EXTREMES;

    #[inline]
    fn closest(asked: &Asked<'_, N>, stack: &mut Stack) -> Option<Hit> {
        let ray = PreparedRay::new(&asked.ray, asked.scale)?;
        let hit = closest::<N, T>(asked.tree, &ray, stack)?;
        let t = ray.unscaled(hit.t);
        Some(Hit { t, ..hit })
    }

    #[inline]
    fn any(asked: &Asked<'_, N>, skipped: Option<u32>, stack: &mut Stack) -> bool {
        PreparedRay::new(&asked.ray, asked.scale)
            .is_some_and(|ray| any::<N, T>(asked.tree, &ray, skipped, stack))
    }
}
