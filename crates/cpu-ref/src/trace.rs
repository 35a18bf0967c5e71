//! Traces the rays of a query in parallel, each individually.

use crate::extreme::ExtremeSearch;
use crate::geometry::Geometry;
use crate::output::{HitCounts, RayResult, TraceOutput};
use crate::scale::Scale;
use crate::search::RaySearch;
use crate::shadow::Light;
use crate::traversal::TreeTraversal;
use backend::{Intersector, Query, QueryKind, Rays};
use geom::{Hit, Ray};
use std::sync::atomic::AtomicU64;

/// Rays that one task traces.
const RUN: usize = 512;

/// A query, and the data that all its rays share.
#[derive(Clone, Copy)]
pub struct QueryTracer<'a> {
    /// The rays and the kind of query.
    pub query: Query<'a>,
    /// Boxes and triangles.
    pub tree: &'a dyn TreeTraversal,
    /// Corners of the triangles.
    pub geometry: Geometry<'a>,
    /// The triangle test.
    pub intersector: Intersector,
    /// Data that shadow rays share, if the query traces them.
    pub light: Option<Light>,
    /// Counts rays that were resolved in exact arithmetic.
    pub exact_rays: &'a AtomicU64,
}

impl<'a> QueryTracer<'a> {
    /// Traces all rays and writes the results in their order.
    pub fn trace(&self, out: TraceOutput<'_>) -> HitCounts {
        self.trace_from(0, out)
    }

    /// Traces as many rays as `out` has entries, from the ray with index `first` on.
    fn trace_from(&self, first: usize, mut out: TraceOutput<'_>) -> HitCounts {
        let count = out.count();
        if count > RUN {
            let half = (count / 2).next_multiple_of(RUN);
            let rest = out.split_off(half);
            let trace_rest = || self.trace_from(first + half, rest);
            let (a, b) = rayon::join(|| self.trace_from(first, out), trace_rest);
            return a + b;
        }
        let mut counts = HitCounts::default();
        for i in 0..count {
            let result = self.result(first + i);
            counts.hits += u64::from(result.hit.is_hit());
            counts.blocked += u64::from(result.blocked);
            out.set(i, result);
        }
        counts
    }

    /// Traces one ray, and its shadow ray if the query has a light.
    pub fn result(&self, index: usize) -> RayResult {
        let search = self.search(self.ray(index), self.geometry.scale);
        let extreme = ExtremeSearch::of(&search);
        if self.query.kind == QueryKind::Any {
            let blocked = match &extreme {
                Some(extreme) => extreme.any(None),
                None => search.any(None),
            };
            return RayResult {
                hit: Hit::MISS,
                blocked,
            };
        }
        let closest = match &extreme {
            Some(extreme) => extreme.closest(),
            None => search.closest(),
        };
        let hit = closest.unwrap_or(Hit::MISS);
        let light = self.light.filter(|_| hit.is_hit());
        let blocked = light.is_some_and(|light| match &extreme {
            Some(extreme) => extreme.is_occluded(&hit, light.position),
            None => self.is_occluded(&search.ray, &hit, &light),
        });
        RayResult { hit, blocked }
    }

    /// Returns whether the hit of `ray` is in shadow.
    fn is_occluded(&self, ray: &Ray, hit: &Hit, light: &Light) -> bool {
        let Geometry { scale, .. } = self.geometry;
        let corners = self.geometry.scaled_corners(hit.triangle);
        let shadow = light.ray(hit, &corners, scale.apply(ray.origin));
        self.search(shadow, Scale::ONE).any(Some(hit.triangle))
    }

    /// Returns the ray with an index.
    fn ray(&self, index: usize) -> Ray {
        match self.query.rays {
            Rays::List(rays) => rays[index],
            Rays::Camera(camera) => {
                let width = camera.width as usize;
                camera.ray((index % width) as u32, (index / width) as u32)
            }
            Rays::OnDevice(_) => Ray::VOID,
        }
    }

    /// Creates the search of a ray. `scale` converts the ray's units to scaled units.
    #[inline]
    pub fn search(&self, ray: Ray, scale: Scale) -> RaySearch<'a> {
        RaySearch {
            tree: self.tree,
            geometry: self.geometry,
            intersector: self.intersector,
            ray,
            scale,
            exact_rays: self.exact_rays,
        }
    }
}

/// Searches for hits of a ray. With `watertight` and `exact`, the ray must not be [extreme](crate::is_extreme).
impl RaySearch<'_> {
    /// Returns the closest hit, with `t` in the ray's own units.
    pub fn closest(&self) -> Option<Hit> {
        if self.intersector.is_exact() {
            self.closest_exact()
        } else {
            self.closest_single_precision()
        }
    }

    /// Returns whether the ray hits any triangle except `skipped`.
    pub fn any(&self, skipped: Option<u32>) -> bool {
        if self.intersector.is_exact() {
            self.any_exact(skipped)
        } else {
            self.any_single_precision(skipped)
        }
    }
}
