//! Random triangles, and closed meshes.

use crate::verifier::Verifier;
use crate::watertight::{tally, trace};
use conformance::{Target, aimed};
use geom::{Animation, Point, Ray, Triangle};
use integration::share;
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        Trial::test("soup::every_answer_can_be_explained", soups),
        Trial::test("stack::equal_distances_go_to_the_least_index", stack),
        Trial::test("ball::no_ray_from_inside_gets_out", from_inside),
        Trial::test("ball::the_same_rays_hit_from_outside", from_outside),
    ]
}

fn animation(corners: &[Triangle]) -> Arc<Animation> {
    let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    let animation = Animation::new(vec![corners.concat()], indices.collect());
    Arc::new(animation.expect("three vertices a triangle"))
}

/// Triangles whose coordinates are small integers or anything, so that there are ties, at several sizes.
fn soups() -> Result<(), Failed> {
    let mut rng = fastrand::Rng::with_seed(3);
    for case in 0..240 {
        let scale = [1.0, 1e-20, 1e20, 1024.0][case % 4];
        let point = |rng: &mut fastrand::Rng| -> Point {
            let coordinate = |()| match rng.bool() {
                true => f32::from(rng.i8(-4..=4)),
                false => 8.0 * rng.f32() - 4.0,
            };
            [(); 3].map(coordinate).map(|x| x * scale)
        };
        let count = rng.usize(1..40);
        let corners: Vec<Triangle> = (0..count)
            .map(|_| [(); 3].map(|()| point(&mut rng)))
            .collect();
        // Half of them at edges and vertices.
        let ray = |i: usize| {
            let origin = point(&mut rng);
            let [a, b, c] = corners[rng.usize(..count)];
            let (v, w) = (rng.f32(), rng.f32());
            let [v, w] = match i % 4 {
                0 => [v, 0.0],
                1 => [v.round(), 0.0],
                _ => [v, w * (1.0 - v)],
            };
            let at: Point = std::array::from_fn(|k| a[k] + v * (b[k] - a[k]) + w * (c[k] - a[k]));
            Ray::new(origin, std::array::from_fn(|k| at[k] - origin[k]))
        };
        let rays: Vec<Ray> = (0..60).map(ray).filter(Ray::is_valid).collect();
        let hits = trace(&animation(&corners), 0.0, &rays);
        tally(&Verifier::new(corners), &rays, &hits)
            .map_err(|e| format!("case {case}: {}", e.message().unwrap_or("wrong")))?;
    }
    Ok(())
}

/// Triangles of all sizes in one plane, whose distance `watertight` computes
/// without rounding: so all that a ray meets are at the same distance.
fn stack() -> Result<(), Failed> {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut near = |centre: [f32; 2], size: f32| -> Point {
        let [x, y] = centre.map(|c| c + size * (rng.f32() - 0.5));
        [x, y, 0.0]
    };
    let corners: Vec<Triangle> = (0..400)
        .map(|i| {
            let [x, y, _] = near([0.0; 2], 4.0);
            [(); 3].map(|()| near([x, y], if i % 4 == 3 { 3.0 } else { 0.8 }))
        })
        .collect();
    let rays: Vec<Ray> = (0..6000)
        .map(|_| {
            let [x, y, _] = near([0.0; 2], 4.0);
            let [dx, dy, _] = near([0.0; 2], 0.5);
            Ray::new([x, y, 2.0], [dx, dy, -1.0])
        })
        .collect();
    let hits = trace(&animation(&corners), 0.0, &rays);
    let verify = Verifier::new(corners);
    let ties = rays
        .iter()
        .filter(|r| verify.exact(r).is_some_and(|e| e.tie));
    let (ties, tally) = (ties.count(), tally(&verify, &rays, &hits)?);
    if ties < 4000 || tally.differing() > 2 {
        return Err(format!("{ties} ties: {tally:?}").into());
    }
    Ok(())
}

/// A closed, lumpy ball, star-shaped as seen from its centre: an octahedron split
/// four times, its vertices pushed in and out.
fn ball(centre: Point) -> Vec<Triangle> {
    let poles = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut corners: Vec<Triangle> = Vec::new();
    for octant in 0..8_u32 {
        let sign = |i: usize| if octant >> i & 1 == 0 { 1.0 } else { -1.0 };
        corners.push(std::array::from_fn(|i| poles[i].map(|x: f32| x * sign(i))));
    }
    for _ in 0..4 {
        corners = corners.iter().flat_map(split).collect();
    }
    let lump = |p: Point| {
        let length = p.iter().map(|x| x * x).sum::<f32>().sqrt();
        let bits = p.iter().fold(17_u32, |h, x| {
            (h ^ x.to_bits()).wrapping_mul(0x9E37_79B1).rotate_left(13)
        });
        let radius = 0.9 + 0.1 * (bits >> 8) as f32 / (1 << 24) as f32;
        std::array::from_fn(|i| p[i] / length * radius + centre[i])
    };
    corners.into_iter().map(|t| t.map(lump)).collect()
}

fn split(&[a, b, c]: &Triangle) -> [Triangle; 4] {
    // Adding zero makes every zero positive, so that shared corners have the same bits.
    let middle =
        |p: Point, q: Point| -> Point { std::array::from_fn(|i| 0.5 * (p[i] + q[i]) + 0.0) };
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

const CENTRES: [f32; 4] = [0.0, 10.0, 1e3, 1e5];

fn from_inside() -> Result<(), Failed> {
    for offset in CENTRES {
        let centre = [offset, -offset, offset];
        let animation = animation(&ball(centre));
        for target in Target::ALL {
            let mut rays = aimed(&animation, 0.0, target, 1.0, share(20_000));
            for ray in &mut rays {
                let aim: Point = std::array::from_fn(|i| ray.origin[i] + ray.direction[i]);
                *ray = Ray::new(centre, std::array::from_fn(|i| aim[i] - centre[i]));
            }
            let hits = trace(&animation, 0.0, &rays);
            let misses = hits.closest.iter().filter(|h| !h.is_hit()).count();
            if misses > 0 {
                return Err(format!("{misses} {target:?} rays get out at offset {offset}").into());
            }
        }
    }
    Ok(())
}

/// Rays at insides find exactly the oracle's triangles; others may name a
/// neighbour, and miss only where every triangle they meet is within rounding of
/// being missed: at the silhouette.
fn from_outside() -> Result<(), Failed> {
    for offset in CENTRES {
        let corners = ball([offset, 0.0, -offset]);
        let animation = animation(&corners);
        let verify = Verifier::new(corners);
        for target in Target::ALL {
            let rays = aimed(&animation, 0.0, target, 2.0, share(8000));
            let hits = trace(&animation, 0.0, &rays);
            let tally = tally(&verify, &rays, &hits)?;
            if matches!(target, Target::Inside) && tally.differing() > 0 {
                return Err(format!("rays at insides differ at {offset}: {tally:?}").into());
            }
        }
    }
    Ok(())
}
