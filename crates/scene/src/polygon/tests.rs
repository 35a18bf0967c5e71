//! Polygons of every shape have n - 2 triangles. The triangles of simple polygons do not overlap.

use super::*;
use glam::DVec3;
use proptest::prelude::*;
use std::collections::BTreeSet;

fn triangles(points: &[Position]) -> Vec<[u32; 3]> {
    let mut polygons = Polygons::default();
    polygons.vertices = points.len();
    let corners: Vec<u32> = (0..points.len() as u32).collect();
    polygons.push(&corners).unwrap();
    let found = triangulate(&polygons, points).unwrap();
    assert_eq!(found.fanned, 0);
    found.triangles
}

fn fan(vertices: u32) -> Vec<[u32; 3]> {
    (1..vertices - 1).map(|v| [0, v, v + 1]).collect()
}

fn flat(points: &[[f64; 2]]) -> Vec<Position> {
    points.iter().map(|&[x, y]| [x, y, 0.0]).collect()
}

/// Returns twice the area of a triangle, as a vector.
fn area(points: &[Position], [a, b, c]: [u32; 3]) -> DVec3 {
    let at = |v: u32| DVec3::from(points[v as usize]);
    (at(b) - at(a)).cross(at(c) - at(a))
}

/// Checks that the triangles form a disk whose boundary is the polygon, in its orientation.
fn check_disk(points: &[Position], triangles: &[[u32; 3]]) {
    let n = points.len() as u32;
    assert_eq!(triangles.len(), n as usize - 2);
    let edges = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let all: BTreeSet<[u32; 2]> = edges.collect();
    assert_eq!(all.len(), 3 * triangles.len(), "an edge occurs twice");
    for v in 0..n {
        assert!(all.contains(&[v, (v + 1) % n]), "edge {v} is lost");
    }
    let is_rim = |[a, b]: [u32; 2]| b == (a + 1) % n;
    assert!(
        all.iter()
            .all(|&[a, b]| is_rim([a, b]) || all.contains(&[b, a]))
    );
}

/// Checks that the triangles cover a simple polygon exactly once: no triangle is flipped.
fn check_cover(points: &[Position], triangles: &[[u32; 3]]) {
    check_disk(points, triangles);
    let whole: DVec3 = triangles.iter().map(|&t| area(points, t)).sum();
    for &t in triangles {
        let part = area(points, t).dot(whole) / whole.length_squared();
        assert!(part >= -1e-5, "{t:?} is turned over: {part}");
    }
}

#[test]
fn convex_polygons_become_fans() {
    let square = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let with_collinear = flat(&[
        [0.0, 0.0],
        [1.0, 0.0],
        [2.0, 0.0],
        [2.0, 2.0],
        [1.0, 2.0],
        [0.0, 2.0],
    ]);
    let with_repeated = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]);
    for points in [square, with_collinear, with_repeated] {
        let back: Vec<_> = points.iter().rev().copied().collect();
        for points in [points, back] {
            assert_eq!(triangles(&points), fan(points.len() as u32));
        }
    }
}

#[test]
fn triangulates_arrow_from_any_vertex() {
    let arrow = [[2.0, 2.0], [0.0, 1.0], [-2.0, 2.0], [0.0, 0.0]];
    assert_eq!(triangles(&flat(&arrow)), [[0, 1, 3], [1, 2, 3]]);
    for first in 0..4 {
        let mut turned = arrow;
        turned.rotate_left(first);
        let points = flat(&turned);
        check_cover(&points, &triangles(&points));
        turned.reverse();
        let points = flat(&turned);
        check_cover(&points, &triangles(&points));
    }
}

#[test]
fn collinear_vertices_are_kept() {
    // A comb with repeated and collinear vertices on every side of every tooth.
    let mut rim = vec![[0.0, -1.0]];
    for tooth in (0..5).rev().map(|i| f64::from(i) * 2.0) {
        let side = [
            [2.0, 0.0],
            [1.5, 1.0],
            [1.0, 2.0],
            [1.0, 2.0],
            [0.5, 1.0],
            [0.0, 0.0],
        ];
        rim.extend(side.map(|[x, y]| [tooth + x, y]));
    }
    rim.insert(1, [10.0, -1.0]);
    rim.insert(1, [5.0, -1.0]);
    let points = flat(&rim);
    check_cover(&points, &triangles(&points));
}

#[test]
fn degenerate_polygons_are_triangulated() {
    let nan = f64::NAN;
    let huge = f64::from(f32::MAX);
    for rim in [
        vec![[0.0, 0.0]; 5],
        vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0]],
        vec![[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
        vec![
            [0.0, 0.0],
            [4.0, 3.0],
            [4.0, 0.0],
            [0.0, 2.0],
            [1.0, 1.0],
            [0.0, 0.0],
        ],
        vec![
            [0.0, 1.0],
            [0.6, -0.8],
            [-0.95, 0.3],
            [0.95, 0.3],
            [-0.6, -0.8],
        ],
        vec![[nan, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]],
        vec![[2.0, 2.0], [0.0, f64::INFINITY], [-2.0, 2.0], [0.0, 0.0]],
        vec![
            [-huge, -huge],
            [huge, -huge],
            [huge, huge],
            [0.0, 0.0],
            [-huge, huge],
        ],
        vec![[0.0, 0.0], [1e-45, 0.0], [0.0, 1e-45], [1e-45, 1e-45]],
    ] {
        let points = flat(&rim);
        check_disk(&points, &triangles(&points));
    }
}

#[test]
fn complete_fills_all_gaps() {
    let mut ears = fan(8);
    ears.sort_unstable_by_key(|&[a, b, c]| (a, !c, b));
    for kept in 0..1 << ears.len() {
        let some = ears.iter().enumerate().filter(|(i, _)| kept >> i & 1 == 1);
        let some: Vec<_> = some.map(|(_, &ear)| ear).collect();
        let mut filled = Vec::new();
        complete(&some, 8, |t| filled.push(t));
        check_disk(&[[0.0; 3]; 8], &filled);
        assert!(some.iter().all(|ear| filled.contains(ear)));
    }
    let crossing = [[0, 2, 4], [1, 3, 5], [1, 2, 5]];
    let mut filled = Vec::new();
    complete(&crossing, 6, |t| filled.push(t));
    check_disk(&[[0.0; 3]; 6], &filled);
}

#[test]
fn oversized_concave_polygons_are_counted() {
    let count = MAX_CLIPPED + 1;
    let point = |i: usize| {
        let (sin, cos) = (i as f64 / count as f64 * std::f64::consts::TAU).sin_cos();
        let radius = if i.is_multiple_of(2) { 1.0 } else { 0.5 };
        [cos * radius, sin * radius, 0.0]
    };
    let points: Vec<Position> = (0..count).map(point).collect();
    let mut polygons = Polygons::default();
    polygons.vertices = count;
    let corners: Vec<u32> = (0..count as u32).collect();
    polygons.push(&corners).unwrap();
    let found = triangulate(&polygons, &points).unwrap();
    assert_eq!((found.triangles.len(), found.fanned), (count - 2, 1));
}

proptest! {
    /// Stars of any size around the origin, rotated in space, with collinear and repeated vertices.
    #[test]
    fn simple_polygons_are_covered_once(
        radii in prop::collection::vec((0.1_f64..1.0, 0..4_u8), 3..40),
        axis in prop::array::uniform3(-1.0_f64..1.0),
        angle in -3.0_f64..3.0,
        exponent in -30..37_i32,
        is_backwards: bool,
    ) {
        let count = radii.len() as f64;
        let corner = |i: usize| {
            let (sin, cos) = (i as f64 / count * std::f64::consts::TAU).sin_cos();
            DVec3::new(cos, sin, 0.0) * radii[i % radii.len()].0
        };
        let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::X);
        let turn = glam::DQuat::from_axis_angle(axis, angle);
        let mut points: Vec<Position> = Vec::new();
        for (i, &(_, kind)) in radii.iter().enumerate() {
            let (a, b) = (corner(i), corner(i + 1));
            let along: &[f64] = [&[0.0][..], &[0.0, 0.0], &[0.0, 0.5], &[0.0, 0.25, 0.75]][usize::from(kind)];
            points.extend(along.iter().map(|&t| {
                let p = turn * a.lerp(b, t) * 10.0_f64.powi(exponent);
                p.to_array().map(|c| f64::from(c as f32))
            }));
        }
        if is_backwards {
            points.reverse();
        }
        prop_assume!(points.len() > 3);
        check_cover(&points, &triangles(&points));
    }
}
