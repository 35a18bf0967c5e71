//! How near a ray's line passes to a triangle's edges: for judging answers that round.

use geom::{Ray, Triangle};

/// Distance from the line of a valid ray to the nearest point of the triangle's three edges.
///
/// Plain double precision: its error is a few `2^-53` of the distance from the
/// origin to the farthest corner, far below the `2^-24` it is compared with.
pub(crate) fn edge_distance(ray: &Ray, corners: &Triangle) -> f64 {
    let d = ray.direction.map(f64::from);
    let length = dot(d, d).sqrt();
    let d = d.map(|x| x / length);
    // Seen along the ray, the line is the point zero.
    let seen = corners.map(|p| {
        let v = std::array::from_fn(|i| f64::from(p[i]) - f64::from(ray.origin[i]));
        let along = dot(v, d);
        std::array::from_fn(|i| v[i] - along * d[i])
    });
    (0..3)
        .map(|i| distance_to_segment(seen[i], seen[(i + 1) % 3]))
        .fold(f64::INFINITY, f64::min)
}

/// From zero to the segment `p q`.
fn distance_to_segment(p: [f64; 3], q: [f64; 3]) -> f64 {
    let e: [f64; 3] = std::array::from_fn(|i| q[i] - p[i]);
    let squared = dot(e, e);
    let s = if squared > 0.0 {
        (-dot(p, e) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let closest: [f64; 3] = std::array::from_fn(|i| p[i] + s * e[i]);
    dot(closest, closest).sqrt()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_is_measured_across_the_ray() {
        let t = [[0.0, 0.0, 5.0], [4.0, 0.0, 9.0], [0.0, 4.0, 5.0]];
        let at = |x: f32, y: f32| edge_distance(&Ray::new([x, y, 0.0], [0.0, 0.0, 2.0]), &t);
        assert!((at(1.0, 0.25) - 0.25).abs() < 1e-15);
        assert!((at(-3.0, -4.0) - 5.0).abs() < 1e-15);
        assert_eq!(at(2.0, 2.0), 0.0);
    }
}
