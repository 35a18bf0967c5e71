//! Exact predicates of triangles: activity, zero area, signs of the normal, side of a point.

use crate::Point;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Three corners of a triangle.
pub type Triangle = [Point; 3];

#[inline]
pub(crate) fn corners(frame: &[Point], triangle: [u32; 3]) -> Triangle {
    triangle.map(|v| frame[v as usize])
}

/// Returns whether every corner is finite. An inactive triangle is never hit.
#[must_use]
#[inline]
pub fn is_active(corners: &Triangle) -> bool {
    corners.iter().flatten().all(|x| x.is_finite())
}

/// Returns whether the area of an active triangle is exactly zero. A degenerate triangle is never hit.
///
/// If a component of the double-precision cross product exceeds its rounding error, the area is not zero. Otherwise
/// Shewchuk's adaptive predicates (1997) decide.
#[must_use]
pub fn is_degenerate(corners: &Triangle) -> bool {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let f = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    // Each product has three roundings: two differences and the product. The difference of products adds one more.
    // `8 * EPSILON`, times the sum of both magnitudes, bounds these four roundings.
    let is_certainly_nonzero = |i: usize, j: usize| {
        let (p, q) = (e[i] * f[j], e[j] * f[i]);
        (p - q).abs() > 8.0 * f64::EPSILON * (p.abs() + q.abs())
    };
    if is_certainly_nonzero(0, 1) || is_certainly_nonzero(1, 2) || is_certainly_nonzero(2, 0) {
        return false;
    }
    normal_signs(corners) == [0; 3]
}

/// Returns the exact signs of the components of the normal `(b - a) x (c - a)` of an active triangle.
#[must_use]
pub fn normal_signs(corners: &Triangle) -> [i32; 3] {
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    std::array::from_fn(|i| {
        let (x, y) = ((i + 1) % 3, (i + 2) % 3);
        let at = |p: [f64; 3]| Coord { x: p[x], y: p[y] };
        sign(orient2d(at(a), at(b), at(c)))
    })
}

/// Returns the exact side of an active triangle's plane for a finite point.
///
/// The result is 1 on the side of the normal `(b - a) x (c - a)`, -1 on the other side, and 0 in the plane.
#[must_use]
pub fn side_of(corners: &Triangle, point: Point) -> i32 {
    let at = |p: Point| {
        let [x, y, z] = p.map(f64::from);
        Coord3D { x, y, z }
    };
    let [a, b, c] = corners.map(at);
    // Shewchuk's sign is positive below the plane, from where the corners appear clockwise.
    -sign(orient3d(a, b, c, at(point)))
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collinear_triangles_are_degenerate() {
        let a = [1.0, 1.0, 1.0];
        let b = [3.0, 3.0, 3.0];
        assert!(is_degenerate(&[a, b, [2.0, 2.0, 2.0]]));
        assert!(is_degenerate(&[a, a, b]));
        assert!(is_degenerate(&[a, a, a]));
        let off = f32::from_bits(2.0_f32.to_bits() + 1);
        assert!(!is_degenerate(&[a, b, [2.0, 2.0, off]]));
    }

    #[test]
    fn degeneracy_is_independent_of_scale() {
        for s in [1e-40_f32, 1e-20, 1.0, 1e20, 1e38] {
            let flat = [[0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0]];
            let line = [[0.0; 3], [s, s, 0.0], [2.0 * s, 2.0 * s, 0.0]];
            assert!(!is_degenerate(&flat) && is_degenerate(&line), "{s}");
        }
    }

    #[test]
    fn degeneracy_is_exact_across_exponents() {
        let tiny = f32::from_bits(1);
        let needle = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, tiny, 0.0]];
        let long = [[1e30, 0.0, 0.0], [tiny, tiny, 0.0], [0.0; 3]];
        assert!(!is_degenerate(&needle) && !is_degenerate(&long));
    }

    #[test]
    fn sides_and_normals_are_exact() {
        for s in [1e-44_f32, 1.0, 1e38] {
            let flat = [[0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0]];
            assert_eq!(normal_signs(&flat), [0, 0, 1]);
            for (z, side) in [(s, 1), (-s, -1), (0.0, 0), (f32::from_bits(1), 1)] {
                assert_eq!(side_of(&flat, [s, s, z]), side, "{s} {z}");
            }
            assert_eq!(normal_signs(&[flat[0], flat[2], flat[1]]), [0, 0, -1]);
            let tilted = [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]];
            assert_eq!(normal_signs(&tilted), [1, 1, 1]);
        }
    }

    #[test]
    fn non_finite_coordinate_makes_triangle_inactive() {
        assert!(is_active(&[[0.0; 3]; 3]));
        assert!(!is_active(&[[0.0; 3], [0.0, f32::NAN, 0.0], [0.0; 3]]));
        assert!(!is_active(&[[0.0; 3], [0.0; 3], [f32::INFINITY, 0.0, 0.0]]));
    }
}
