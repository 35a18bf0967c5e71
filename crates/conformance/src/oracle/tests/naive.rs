//! The definition written down once more, as plainly as rational numbers allow: tests compare with it.

use geom::{Point, Ray, Triangle};
use num_rational::BigRational;
use num_traits::{Signed, Zero};

type Vector = [BigRational; 3];

/// Every hit as `(t, triangle, on an edge)`, by exact `t`, then by index.
pub(crate) fn all(ray: &Ray, corners: &[Triangle]) -> Vec<(BigRational, u32, bool)> {
    let one = |(i, c): (usize, &Triangle)| hit(ray, c).map(|(t, edge)| (t, i as u32, edge));
    let mut hits: Vec<_> = corners.iter().enumerate().filter_map(one).collect();
    hits.sort();
    hits
}

/// Meets the plane, then asks of each edge on which side the point lies.
fn hit(ray: &Ray, corners: &Triangle) -> Option<(BigRational, bool)> {
    if !ray.is_valid() || corners.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    let [a, b, c] = corners.map(vector);
    let (o, d) = (vector(ray.origin), vector(ray.direction));
    let n = cross(&sub(&b, &a), &sub(&c, &a));
    let slope = dot(&n, &d);
    if slope.is_zero() {
        return None;
    }
    let t = dot(&n, &sub(&a, &o)) / slope;
    let p: Vector = std::array::from_fn(|i| &o[i] + &t * &d[i]);
    let side = |a: &Vector, b: &Vector| dot(&n, &cross(&sub(b, a), &sub(&p, a)));
    let sides = [side(&a, &b), side(&b, &c), side(&c, &a)];
    let inside = !sides.iter().any(Signed::is_negative);
    (inside && beyond(&t, ray.t_min) && before(&t, ray.t_max))
        .then(|| (t, sides.iter().any(Zero::is_zero)))
}

fn beyond(t: &BigRational, t_min: f32) -> bool {
    BigRational::from_float(t_min).map_or(t_min < 0.0, |x| *t > x)
}

fn before(t: &BigRational, t_max: f32) -> bool {
    BigRational::from_float(t_max).map_or(t_max > 0.0, |x| *t < x)
}

fn vector(p: Point) -> Vector {
    p.map(|x| BigRational::from_float(x).expect("tests ask with finite numbers"))
}

fn sub(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

fn dot(a: &Vector, b: &Vector) -> BigRational {
    (0..3)
        .map(|i| &a[i] * &b[i])
        .fold(BigRational::zero(), |s, x| s + x)
}
