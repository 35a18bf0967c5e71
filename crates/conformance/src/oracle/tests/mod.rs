//! Cases by hand, and the naive version on random ones.

mod naive;

use super::*;
use crate::nth_case;

const SQUARE: [Triangle; 2] = [
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
];

/// A hit of the exact answer.
fn hit(triangle: u32, t: f64, [edge, tie]: [bool; 2]) -> Option<ExactHit> {
    Some(ExactHit {
        triangle,
        t,
        edge,
        tie,
    })
}

fn closest(corners: &[Triangle], ray: &Ray) -> Option<ExactHit> {
    Oracle::new(corners.to_vec()).closest(ray)
}

#[test]
fn the_greatest_and_the_least_numbers_are_no_trouble() {
    for s in [f32::MAX, 1e30, 1e-30, f32::from_bits(8)] {
        let corners = SQUARE.map(|t| t.map(|p| p.map(|x| x * s)));
        let ray = Ray::new([0.5 * s, 0.25 * s, s], [0.0, 0.0, -s]);
        let found = closest(&corners, &ray);
        assert_eq!(found, hit(0, 1.0, [false, false]), "{s}");
    }
    let far = Ray::new([0.0, 0.0, f32::MAX], [0.0, 0.0, -f32::from_bits(1)]);
    let t = closest(&SQUARE, &far).map(|h| h.t);
    assert_eq!(t, Some(f64::from(f32::MAX) / f64::from(f32::from_bits(1))));
}

#[test]
fn a_ray_leaks_nowhere_though_it_does_in_double_precision() {
    let (corners, ray) = leak();
    let found = closest(&corners, &ray);
    assert_eq!(found, hit(0, 1.0, [true, true]));
    assert_eq!(naive::all(&ray, &corners).len(), 2);
}

/// Two triangles and a ray through exactly the middle of the edge they share.
fn leak() -> ([Triangle; 2], Ray) {
    let (a, b) = (
        [125_496.0, -74_074.0, -194_525.0],
        [132_966.0, 145_922.0, 96_123.0],
    );
    let (c, d) = (
        [88_925.0, 3_958.0, 74_750.0],
        [122_460.0, 12_028.0, -193_949.0],
    );
    let ray = Ray::new(
        [-197_847.0, -163_721.0, 59_272.0],
        [327_078.0, 199_645.0, -108_473.0],
    );
    ([[a, b, c], [d, b, a]], ray)
}

/// Scenes of every kind that have few triangles, one of them twice, with some rays of every kind.
fn cases() -> impl Iterator<Item = (Vec<Triangle>, Vec<Ray>)> {
    let few = (0..200).map(|i| nth_case(9, i));
    few.filter(|case| (1..=40).contains(&case.animation.triangle_count()))
        .map(|case| {
            let moment = case.animation.at(case.times[1]).unwrap();
            let all = 0..case.animation.triangle_count() as u32;
            let mut corners: Vec<_> = all.map(|t| moment.corners(t)).collect();
            corners.push(corners[0]);
            (corners, case.rays.into_iter().step_by(7).collect())
        })
}

#[test]
fn the_oracle_agrees_with_the_naive_version() {
    for (corners, rays) in cases() {
        let oracle = Oracle::new(corners.clone());
        for ray in &rays {
            let naive = naive::all(ray, &corners);
            let all = oracle.all(ray);
            let found: Vec<_> = all.iter().map(|h| (h.triangle, h.edge)).collect();
            let expected: Vec<_> = naive.iter().map(|h| (h.1, h.2)).collect();
            assert_eq!(found, expected, "{ray:?}");
            for (i, h) in all.iter().enumerate() {
                let tie = naive.iter().filter(|n| n.0 == naive[i].0).count() > 1;
                assert_eq!((h.tie, Some(h.t)), (tie, naive[i].0.to_f64()));
            }
            assert_eq!(oracle.closest(ray), all.first().copied());
            for i in 0..corners.len() as u32 {
                let is_hit = all.iter().any(|h| h.triangle == i);
                assert_eq!(oracle.hit_of(ray, i).is_some(), is_hit, "{ray:?} {i}");
            }
        }
    }
}

#[test]
fn double_precision_is_never_wrong_when_it_is_sure() {
    let all = cases().flat_map(|(corners, rays)| {
        let pairs = rays
            .into_iter()
            .flat_map(move |r| corners.clone().into_iter().map(move |c| (r, c)));
        pairs.filter(|(ray, corners)| ray.is_valid() && is_active(corners))
    });
    for (ray, corners) in all {
        let is_right = match (judge(&ray, &corners), cross(&ray, &corners)) {
            (Verdict::Miss, exact) => exact.is_none(),
            (Verdict::Hit(_), None) => false,
            (Verdict::Maybe(_), None) => true,
            (Verdict::Hit(span) | Verdict::Maybe(span), Some(crossing)) => {
                (span.low..=span.high).contains(&to_f64(&crossing))
            }
        };
        assert!(is_right, "{ray:?} {corners:?}");
    }
}
