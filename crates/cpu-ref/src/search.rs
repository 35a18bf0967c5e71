//! The search for hits of one ray in single precision.

use crate::geometry::Geometry;
use crate::intersect::SinglePrecisionTest;
use crate::scale::{MIN_NONZERO, PreparedRay, Scale, flushed};
use crate::traversal::{TreeTraversal, VisitedTriangle};
use backend::Intersector;
use geom::exact::ExactRay;
use geom::{Hit, Ray};
use std::sync::atomic::{AtomicU64, Ordering};

/// A ray with the scene to search for its hits.
#[derive(Clone, Copy)]
pub struct RaySearch<'a> {
    /// Boxes and triangles.
    pub tree: &'a dyn TreeTraversal,
    /// Corners of the triangles.
    pub geometry: Geometry<'a>,
    /// The triangle test.
    pub intersector: Intersector,
    /// The ray, in the units that `scale` converts from. If `is_extreme` is unset, shadow rays are in scaled units. All
    /// other rays are in the scene's units.
    pub ray: Ray,
    /// Conversion from the ray's units to scaled units.
    pub scale: Scale,
    /// Set for [extreme](crate::is_extreme) rays and their shadow rays, if the intersector traces them in exact
    /// arithmetic.
    pub is_extreme: bool,
    /// Counts rays that were resolved in exact arithmetic.
    pub exact_rays: &'a AtomicU64,
}

impl RaySearch<'_> {
    /// Returns the ray as input of exact arithmetic.
    pub(crate) fn exact_ray(&self) -> ExactRay {
        ExactRay {
            ray: self.ray,
            corner_shift: self.geometry.scale.k() - self.scale.k(),
        }
    }

    /// Counts the ray as resolved in exact arithmetic.
    pub(crate) fn count_exact(&self) {
        self.exact_rays.fetch_add(1, Ordering::Relaxed);
    }

    /// Returns the closest hit, with `t` in the ray's own units.
    pub(crate) fn closest_single_precision(&self) -> Option<Hit> {
        let ray = PreparedRay::new(&self.ray, self.scale)?;
        let test = SinglePrecisionTest::new(self.intersector, &ray);
        let mut best = Hit {
            t: ray.t_max,
            ..Hit::MISS
        };
        self.tree.traverse(&ray, &mut |visited, _| {
            let hit = hit(&ray, &test, visited);
            if let Some(hit) = hit.filter(|hit| hit.is_before(&best)) {
                best = hit;
            }
            // Distances below `MIN_NONZERO` become zero. So a box that begins before this distance may contain a hit at
            // zero with a lower index.
            Some(best.t.max(MIN_NONZERO))
        });
        let t = ray.unscaled(best.t);
        best.is_hit().then_some(Hit { t, ..best })
    }

    /// Returns whether the ray hits any triangle except `skipped`.
    pub(crate) fn any_single_precision(&self, skipped: Option<u32>) -> bool {
        let Some(ray) = PreparedRay::new(&self.ray, self.scale) else {
            return false;
        };
        let test = SinglePrecisionTest::new(self.intersector, &ray);
        self.tree.traverse(&ray, &mut |visited, bound| {
            let is_hit = Some(visited.triangle) != skipped && hit(&ray, &test, visited).is_some();
            (!is_hit).then_some(bound)
        })
    }
}

/// Intersects a ray with a triangle, within the ray's limits and with `t` clamped to the triangle's box.
#[inline]
fn hit(
    ray: &PreparedRay,
    test: &SinglePrecisionTest,
    visited: &VisitedTriangle<'_>,
) -> Option<Hit> {
    let found = test.intersect(ray, visited.data)?;
    let mut t = found.t;
    if t < visited.entry {
        t = visited.entry;
    } else if t > visited.exit {
        t = visited.exit;
    }
    let t = flushed(t);
    (ray.t_min < t && t < ray.t_max).then_some(Hit {
        t,
        u: found.u,
        v: found.v,
        triangle: visited.triangle,
    })
}
