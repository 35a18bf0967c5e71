//! A ball over a floor: what faces the light is lit, what lies behind is dark, wherever it all stands.

use super::{sphere, still, trace};
use backend::{Intersector, QueryKind, Rays};
use geom::{Animation, Camera, Hit, Point};
use std::sync::Arc;

const LIGHT: Point = [0.0, 10.0, 0.0];
const BALL: Point = [0.0, 1.5, 0.0];

/// A unit ball over a floor of many small triangles, all moved by `offset`; and how many are the ball's.
fn ball_and_floor(offset: f32) -> (Arc<Animation>, u32) {
    let ball = sphere(36, 1.0, moved(BALL, offset));
    let mut vertices = ball.first().to_vec();
    let mut triangles = ball.triangles().to_vec();
    let first = vertices.len() as u32;
    let side = 33;
    for i in 0..side * side {
        let [x, z] = [i % side, i / side].map(|k| k as f32 * 0.25 - 4.0);
        vertices.push(moved([x, 0.0, z], offset));
    }
    for (x, z) in (0..side - 1).flat_map(|z| (0..side - 1).map(move |x| (x, z))) {
        let a = first + z * side + x;
        triangles.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
    }
    let all = Animation::new(vec![vertices], triangles).unwrap();
    (Arc::new(all), ball.triangle_count() as u32)
}

fn moved(p: Point, offset: f32) -> Point {
    p.map(|x| x + offset)
}

/// Whether the light must reach a hit (0), must not (1), or may do either (`None`: near the shadow's rim).
fn expected(animation: &Animation, ball_triangles: u32, hit: &Hit, offset: f32) -> Option<u8> {
    let corners = animation.at(0.0).unwrap().corners(hit.triangle);
    let p: [f64; 3] = std::array::from_fn(|i| {
        let [a, b, c] = corners.map(|v| f64::from(v[i]));
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        a + u * (b - a) + v * (c - a) - f64::from(offset)
    });
    if hit.triangle < ball_triangles {
        let to = |q: Point| -> [f64; 3] { std::array::from_fn(|i| f64::from(q[i]) - p[i]) };
        let (n, l) = (to(BALL).map(|x| -x), to(LIGHT));
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let cosine = dot(n, l) / (dot(n, n) * dot(l, l)).sqrt();
        return (cosine.abs() > 0.2).then(|| u8::from(cosine < 0.0));
    }
    // The ball's shadow on the floor is a disc: the light stands straight above.
    let radius = (p[0] * p[0] + p[2] * p[2]).sqrt();
    let rim = 10.0 / (8.5_f64 * 8.5 - 1.0).sqrt();
    ((radius - rim).abs() > 0.1).then(|| u8::from(radius < rim))
}

fn check_shadows(offset: f32, intersector: Intersector) {
    let (animation, ball_triangles) = ball_and_floor(offset);
    let mut backend = still(&animation, intersector);
    let eye = moved([3.0, 1.2, 6.0], offset);
    let target = moved([0.0, 0.7, 0.0], offset);
    let camera = Camera::look_at(eye, target, [0.0, 1.0, 0.0], 45.0, [400, 300]).unwrap();
    let light = moved(LIGHT, offset);
    let kind = QueryKind::ClosestAndShadow { light };
    let hits = trace(&mut backend, Rays::Camera(&camera), kind);
    let mut seen = [0; 2];
    for (hit, &blocked) in hits.closest.iter().zip(&hits.blocked) {
        if !hit.is_hit() {
            assert_eq!(blocked, 0, "a miss is never in shadow");
        } else if let Some(expected) = expected(&animation, ball_triangles, hit, offset) {
            assert_eq!(blocked, expected, "{intersector} {offset} {hit:?}");
            seen[expected as usize] += 1;
        }
    }
    assert!(seen.iter().all(|&n| n > 5000), "{seen:?}");
}

#[test]
fn lit_is_lit_and_dark_is_dark_at_every_distance_from_the_origin() {
    for offset in [0.0, 10.0, 1e3, 1e5] {
        check_shadows(offset, Intersector::Watertight);
    }
    // These leak at edges, but not here.
    check_shadows(0.0, Intersector::MollerTrumbore);
    check_shadows(0.0, Intersector::Woop);
}
