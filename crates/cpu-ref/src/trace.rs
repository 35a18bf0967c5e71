//! Traces the rays of a query in parallel, each individually.

use crate::extreme::{is_extreme, shadow_ray};
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
        let mut search = self.search(self.ray(index), self.geometry.scale);
        search.is_extreme =
            self.intersector.is_watertight() && is_extreme(&self.geometry, search.ray.origin);
        if self.query.kind == QueryKind::Any {
            return RayResult {
                hit: Hit::MISS,
                blocked: search.any(None),
            };
        }
        let hit = search.closest().unwrap_or(Hit::MISS);
        let light = self.light.filter(|_| hit.is_hit());
        let shadow = light.map(|light| self.shadow(&search, &hit, &light));
        let blocked = shadow.is_some_and(|shadow| shadow.any(Some(hit.triangle)));
        RayResult { hit, blocked }
    }

    /// Returns the search of the shadow ray from a hit.
    fn shadow(&self, search: &RaySearch<'a>, hit: &Hit, light: &Light) -> RaySearch<'a> {
        let (ray, geometry) = (&search.ray, &self.geometry);
        if search.is_extreme {
            let corners = geometry.corners(hit.triangle);
            let ray = shadow_ray(ray, hit, &corners, light.position);
            return RaySearch { ray, ..*search };
        }
        let corners = geometry.scaled_corners(hit.triangle);
        let eye = geometry.scale.apply(ray.origin);
        self.search(light.ray(hit, &corners, eye), Scale::ONE)
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

    /// Creates the search of a ray, with `is_extreme` unset. `scale` converts the ray's units to scaled units.
    #[inline]
    pub fn search(&self, ray: Ray, scale: Scale) -> RaySearch<'a> {
        RaySearch {
            tree: self.tree,
            geometry: self.geometry,
            intersector: self.intersector,
            ray,
            scale,
            is_extreme: false,
            exact_rays: self.exact_rays,
        }
    }
}

impl RaySearch<'_> {
    /// Returns the closest hit, with `t` in the ray's own units.
    pub fn closest(&self) -> Option<Hit> {
        if self.is_extreme {
            self.closest_extreme()
        } else if self.intersector.is_exact() {
            self.closest_exact()
        } else {
            self.closest_single_precision()
        }
    }

    /// Returns whether the ray hits any triangle except `skipped`.
    pub fn any(&self, skipped: Option<u32>) -> bool {
        if self.is_extreme {
            self.any_extreme(skipped)
        } else if self.intersector.is_exact() {
            self.any_exact(skipped)
        } else {
            self.any_single_precision(skipped)
        }
    }
}
