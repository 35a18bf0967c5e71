//! Scenes, trees and rays for tests.

mod contract;
mod law;
mod misuse;
mod shadow;
mod trace;
mod watertight;

use crate::CpuBackend;
use backend::{Backend, Generation, Hits, Intersector, Method, Query, QueryKind, Rays};
use bvh_build::{BinaryTree, Boxes, Builder, Cancel};
use bvh_layout::{Converter, Topology};
use geom::{Aabb, Animation, Point, Pose, Ray, Triangle};
use proptest::prelude::RngExt;
use proptest::test_runner::{RngAlgorithm, TestRng};
use std::sync::Arc;

/// The same numbers at every run.
pub(crate) fn rng() -> TestRng {
    TestRng::deterministic_rng(RngAlgorithm::ChaCha)
}

/// Triangles that share no vertex, in one key frame.
pub(crate) fn soup(triangles: &[Triangle]) -> Arc<Animation> {
    let vertices = triangles.concat();
    let corners = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Arc::new(Animation::new(vec![vertices], corners.collect()).unwrap())
}

/// A tree built over any boxes, for instance those of another moment.
pub(crate) fn tree_over<B: Boxes + ?Sized>(boxes: &B) -> Topology {
    let mut tree = BinaryTree::default();
    Builder::new()
        .build(boxes, &Cancel::new(), &mut tree)
        .unwrap();
    Converter::new().convert(&tree, boxes.len(), Vec::new())
}

/// The tree for a moment.
pub(crate) fn tree_at(animation: &Animation, pose: Pose) -> Topology {
    let positions: Vec<Point> = (0..animation.vertex_count() as u32)
        .map(|v| animation.vertex(pose, v))
        .collect();
    tree_over(&(animation, positions.as_slice()))
}

/// A tree that knows nothing of where triangles are: many overlaps, every depth.
pub(crate) fn senseless_tree(animation: &Animation) -> Topology {
    let mut rng = rng();
    let boxes: Vec<Aabb> = (0..animation.triangle_count() as u32)
        .map(|i| {
            if !animation.is_live(i) {
                return Aabb::EMPTY;
            }
            // Exponents spread out make long thin branches.
            let at = 2.0_f32.powi(rng.random_range(-40..40));
            let at = [at, f32::from(rng.random_range(0..8_u8)), 0.0];
            Aabb { min: at, max: at }
        })
        .collect();
    tree_over(boxes.as_slice())
}

/// A backend that has interpolated, preprocessed and refitted.
pub(crate) fn ready(
    animation: &Arc<Animation>,
    intersector: Intersector,
    tree: &Topology,
    pose: Pose,
    threads: usize,
) -> CpuBackend {
    let mut backend = CpuBackend::new(Some(threads)).unwrap();
    let method = Method {
        intersector,
        ..Method::default()
    };
    backend.load(Arc::clone(animation), method).unwrap();
    backend.adopt(tree, Generation(1)).unwrap();
    deform(&mut backend, pose);
    backend.submit().unwrap();
    backend
}

pub(crate) fn deform(backend: &mut CpuBackend, pose: Pose) {
    backend.interpolate(pose).unwrap();
    backend.preprocess().unwrap();
    backend.refit().unwrap();
}

/// A backend that traces a still scene by a good tree.
pub(crate) fn still(animation: &Arc<Animation>, intersector: Intersector) -> CpuBackend {
    let pose = animation.pose(0.0);
    ready(animation, intersector, &tree_at(animation, pose), pose, 1)
}

pub(crate) fn trace(backend: &mut CpuBackend, rays: Rays<'_>, kind: QueryKind) -> Hits {
    backend.trace(Query { rays, kind }).unwrap();
    let ticket = backend.submit().unwrap();
    let mut hits = Hits::default();
    backend.hits(ticket, &mut hits).unwrap();
    hits
}

pub(crate) fn closest(backend: &mut CpuBackend, rays: &[Ray]) -> Vec<geom::Hit> {
    trace(backend, Rays::List(rays), QueryKind::Closest).closest
}

/// Bits of hits, so that equal means equal.
pub(crate) fn bits(hits: &[geom::Hit]) -> Vec<[u32; 4]> {
    let bits = |h: &geom::Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    hits.iter().map(bits).collect()
}

/// A closed sphere round `centre`: `20 * 4^levels` triangles in random order, turned at random.
pub(crate) fn icosphere(levels: u32, radius: f64, centre: Point) -> Animation {
    let (vertices, mut triangles) = subdivide(levels);
    let mut rng = rng();
    for i in (1..triangles.len()).rev() {
        triangles.swap(i, rng.random_range(0..=i));
    }
    for t in &mut triangles {
        t.rotate_left(rng.random_range(0..3));
        if rng.random_range(0..2) == 0 {
            t.swap(0, 1);
        }
    }
    let place = |v: &[f64; 3]| -> Point {
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        std::array::from_fn(|i| (f64::from(centre[i]) + radius * v[i] / length) as f32)
    };
    let vertices = vertices.iter().map(place).collect();
    Animation::new(vec![vertices], triangles).unwrap()
}

fn subdivide(levels: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for s in [-1.0, 1.0] {
        for t in [-g, g] {
            vertices.extend([[s, t, 0.0], [0.0, s, t], [t, 0.0, s]]);
        }
    }
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>() < 4.1;
    let mut triangles = Vec::new();
    for i in 0..12_u32 {
        for j in 0..i {
            for k in 0..j {
                let [a, b, c] = [i, j, k].map(|v| vertices[v as usize]);
                if near(a, b) && near(b, c) && near(c, a) {
                    triangles.push([i, j, k]);
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [p, q] = [a, b].map(|v| vertices[v as usize]);
                let sum: [f64; 3] = std::array::from_fn(|i| p[i] + q[i]);
                let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                let radius = (1.0 + g * g).sqrt();
                vertices.push(sum.map(|x| x / length * radius));
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (vertices, triangles)
}

/// A ball that is crushed; a triangle that comes late, one that shrinks to nothing, one that never is.
pub(crate) fn moving() -> Arc<Animation> {
    let ball = icosphere(3, 1.0, [0.0; 3]);
    let mut triangles = ball.triangles().to_vec();
    let mut first = ball.keys()[0].clone();
    let mut second: Vec<Point> = first
        .iter()
        .map(|p| [p[0] * 2.0, p[1] * 0.1, p[2] + p[0]])
        .collect();
    let mut third: Vec<Point> = first
        .iter()
        .map(|p| [p[1], p[2] * 3.0, p[0] - p[1]])
        .collect();
    let n = first.len() as u32;
    let corner = [[0.0, 2.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 1.0]];
    let nowhere = [[f32::NAN; 3]; 3];
    first.extend([nowhere, corner, nowhere].concat());
    second.extend([corner, [corner[0]; 3], nowhere].concat());
    third.extend([corner, corner, nowhere].concat());
    triangles.extend([0, 3, 6].map(|i| [n + i, n + i + 1, n + i + 2]));
    Arc::new(Animation::new(vec![first, second, third], triangles).unwrap())
}
