//! Scene units to scaled units, "Scale" of "What a hit is" in ARCHITECTURE.md: the host's twin of `wgsl/geometry/units.wgsl`.

use geom::{Point, Range};

/// `2^-exponent`, by which a scene is scaled; the exponent is in -126..=126.
pub(crate) fn scale(exponent: i32) -> f32 {
    f32::from_bits(((127 - exponent) as u32) << 23)
}

/// Whether a ray from `origin`, in the scene's units, is extreme in a scene scaled by `2^-exponent`.
#[must_use]
pub fn is_extreme(origin: Point, range: Range, exponent: i32) -> bool {
    range.is_extreme(scaled_point(origin, exponent))
}

/// A point in scaled units; a coordinate below `2^-64` is zero.
pub(crate) fn scaled_point(point: Point, exponent: i32) -> Point {
    let (by, least) = (scale(exponent), scale(64));
    point.map(|x| {
        let scaled = x * by;
        if scaled.abs() < least { 0.0 } else { scaled }
    })
}
