//! Vectors in double precision, in which no f32 scene overflows or vanishes when squared.

use geom::Point;

/// A point, a direction or a linear colour.
pub(crate) type V3 = [f64; 3];

pub(crate) fn wide(p: Point) -> V3 {
    p.map(f64::from)
}

pub(crate) fn add(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(crate) fn sub(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn mul(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] * b[i])
}

pub(crate) fn scale(a: V3, s: f64) -> V3 {
    a.map(|x| x * s)
}

pub(crate) fn mix(a: V3, b: V3, s: f64) -> V3 {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * s)
}

pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `a` at length 1, or zero where it has no length.
pub(crate) fn unit(a: V3) -> V3 {
    let length = dot(a, a).sqrt();
    if length > 0.0 && length.is_finite() {
        a.map(|x| x / length)
    } else {
        [0.0; 3]
    }
}
