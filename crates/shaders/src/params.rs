//! The host's definitions of `wgsl/lib/params.wgsl` and of the buffer `counts`. A test compares the former by reflection.

use crate::Shape;
use bytemuck::{Pod, Zeroable};
use geom::{Camera, Point, Range};

/// Parameters of a dispatch. The WGSL file explains each member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(
    missing_docs,
    reason = "each member is explained in wgsl/lib/params.wgsl"
)]
pub struct Params {
    pub eye: [f32; 3],
    pub width: u32,
    pub corner: [f32; 3],
    pub height: u32,
    pub across: [f32; 3],
    pub first_group: u32,
    pub down: [f32; 3],
    pub alpha: f32,
    pub light: [f32; 3],
    pub scale_exponent: i32,
    pub count: u32,
    pub first: u32,
    pub leaf_triangles_at: u32,
    pub node_count: u32,
    pub zero: u32,
    pub listed: u32,
    pub destination: u32,
    pub shift: u32,
    pub goal: u32,
    pub rounds: u32,
    pub places: u32,
    pub notes: u32,
    pub rule: u32,
    pub extreme: u32,
    pub tiny: u32,
    pub spread: u32,
    pub scaled_eye: [f32; 3],
    pub depth_exponent: i32,
    pub column: [f32; 3],
    pub wide_at: u32,
    pub row: [f32; 3],
    pub wide_lanes: u32,
    pub depth: [f32; 3],
    pub wide_root: u32,
    pub pixel_margin: f32,
    pub clearance: f32,
    pub padding: [u32; 2],
}

impl Params {
    /// Returns parameters for a scene scaled by `2^-scale_exponent` (in -126..=126) and a tree of this shape.
    pub fn of(scale_exponent: i32, tree: &Shape) -> Self {
        Self {
            scale_exponent,
            clearance: f32::INFINITY,
            ..tree.params
        }
    }

    /// Returns the part that [`crate::MODULE`] reads.
    #[must_use]
    pub fn for_module(&self) -> Self {
        Self {
            scale_exponent: self.scale_exponent,
            node_count: self.node_count,
            extreme: self.extreme,
            tiny: self.tiny,
            spread: self.spread,
            ..Self::default()
        }
    }

    /// Sets the range of the coordinates. `None` lets the device measure it; [`Params::spread`] then keeps its value.
    pub fn at_range(mut self, range: Option<Range>) -> Self {
        match range {
            Some(range) => {
                self.clearance = range.clearance * scale(self.scale_exponent);
                (self.extreme, self.tiny) = (range.extreme.into(), range.tiny.into());
                self.spread = range.spread.into();
            }
            None => self.extreme = Self::UNKNOWN,
        }
        self
    }

    /// Clears an unknown range, so that rays are extreme by their origin alone.
    pub(crate) fn known(mut self) -> Self {
        if self.is_unknown() {
            self.extreme = 0;
        }
        self
    }

    /// Returns whether only [`crate::BufferName::Range`] holds which rays are extreme.
    pub fn is_unknown(&self) -> bool {
        self.extreme == Self::UNKNOWN
    }

    /// Value of [`Params::extreme`] if [`crate::BufferName::Range`] holds whether rays are extreme.
    pub(crate) const UNKNOWN: u32 = 2;

    /// Returns whether a ray from `origin`, in scene units, is extreme.
    pub fn is_extreme(&self, origin: Point) -> bool {
        let range = Range {
            extreme: self.extreme == 1,
            tiny: self.tiny != 0,
            spread: self.spread == 1,
            clearance: self.clearance,
        };
        range.is_extreme(scaled_point(origin, self.scale_exponent))
    }

    /// Sets the camera.
    pub(crate) fn through(mut self, camera: &Camera) -> Self {
        (self.eye, self.corner) = (camera.eye, camera.corner);
        (self.across, self.down) = (camera.across, camera.down);
        (self.width, self.height) = (camera.width, camera.height);
        self.scaled_eye = scaled_point(camera.eye, self.scale_exponent);
        self
    }

    /// Sets the light.
    pub(crate) fn lit(mut self, light: Point) -> Self {
        self.light = scaled_point(light, self.scale_exponent);
        self
    }
}

/// Counters that the kernels of a submission increment, in the layout of the buffer `counts`.
/// The buffer is cleared before the submission's first stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Counts {
    /// Leaves whose triangle is inactive, by `preprocess_treelets*` or `cluster_leaves`.
    pub inactive: u32,
    /// Leaves whose triangle is active but of zero area, by the same kernels.
    pub degenerate: u32,
    /// Rays that hit, by `trace_*` and `any_*`.
    pub hits: u32,
    /// Hits in shadow, by `shadow_*`.
    pub blocked: u32,
    /// Half areas of all nodes except the root, in scaled units, by the last refit or build.
    pub areas: f32,
    /// The root's half area, in scaled units.
    pub root_area: f32,
    /// Counterpart of `areas` for the candidate tree that is evaluated next to the current one. Both have the same root box.
    pub candidate_areas: f32,
    /// Rays that `trace_*` and `any_*` left to `resolve_exact_*`, for `exact`.
    pub open: u32,
    /// Shadow rays that `shadow_*` left to `resolve_exact_*`, for `exact`.
    pub open_shadows: u32,
    /// Candidate notes for `resolve_exact_*`.
    pub notes: u32,
    /// Rays that `resolve_exact_*` left to `fallback_*`, for `exact`.
    pub hard: u32,
    /// Shadow rays that `resolve_exact_*` left to `fallback_*`, for `exact`.
    pub hard_shadows: u32,
    /// Tiles that `cover_small` and `cover_large` wrote.
    pub tiles: u32,
    /// Triangles that were too large for `cover_small`.
    pub large: u32,
    /// Approximate number of ray-triangle tests in `rasterize`.
    pub tests: u32,
    /// 1 if rasterization was incomplete, so that `resolve` traverses the tree: see [`crate::RasterBackoff`].
    pub untold: u32,
    /// 1 if `trace_rays` or `any_rays` left any ray to `extreme_*`.
    pub left: u32,
    /// 2 if `measure_range` found coordinates of very different sizes, 1 if it did not, 0 if it did not run.
    pub spread: u32,
}

impl Counts {
    /// Adds the counts of a further trace of the same submission.
    pub fn add_trace(&mut self, other: &Self) {
        self.hits += other.hits;
        self.blocked += other.blocked;
        self.open += other.open;
    }

    /// Returns whether coordinates have very different sizes, if `measure_range` ran.
    pub fn is_spread(&self) -> Option<bool> {
        (self.spread > 0).then_some(self.spread == 2)
    }

    /// Returns the number of rays, including shadow rays, that exact integers resolved.
    pub fn settled(&self) -> u64 {
        u64::from(self.open) + u64::from(self.open_shadows)
    }
}

/// Returns `2^-exponent`, by which a scene is scaled ("Scale" in `docs/design/hits.md`). The exponent is in -126..=126.
pub(crate) fn scale(exponent: i32) -> f32 {
    f32::from_bits(((127 - exponent) as u32) << 23)
}

/// Returns a point in scaled units. Coordinates below `2^-64` become zero.
pub(crate) fn scaled_point(point: Point, exponent: i32) -> Point {
    let (by, least) = (scale(exponent), scale(64));
    point.map(|x| {
        let scaled = x * by;
        if scaled.abs() < least { 0.0 } else { scaled }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_scaled_and_flushed() {
        let point = [3.0e-3, f32::MIN_POSITIVE, -2.0e-39];
        let (least, none) = ((-64_f32).exp2(), Shape::default());
        for k in -126..=126 {
            let params = Params::of(k, &none).lit(point);
            let exact = point.map(|x| f64::from(x) * (-f64::from(k)).exp2());
            let snapped = exact.map(|x| match x.abs() < f64::from(least) {
                true => 0.0,
                false => x as f32,
            });
            let found = params.light.map(f32::to_bits);
            assert_eq!(found, snapped.map(f32::to_bits), "{k}");
        }
        let odd = Params::of(3, &none).lit([f32::NAN, f32::INFINITY, 0.0]);
        assert!(odd.light[0].is_nan() && odd.light[1] == f32::INFINITY);
    }
}
