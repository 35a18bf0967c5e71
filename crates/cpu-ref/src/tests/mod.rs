//! Scenes, trees and rays for tests.

mod contract;
mod law;
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
use std::f64::consts::PI;
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
    let moment = animation.moment(pose).unwrap();
    let positions: Vec<Point> = (0..animation.vertex_count() as u32)
        .map(|v| moment.vertex(v))
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
    backend.hits(ticket).unwrap().clone()
}

pub(crate) fn closest(backend: &mut CpuBackend, rays: &[Ray]) -> Vec<geom::Hit> {
    trace(backend, Rays::List(rays), QueryKind::Closest).closest
}

/// Bits of hits, so that equal means equal.
pub(crate) fn bits(hits: &[geom::Hit]) -> Vec<[u32; 4]> {
    let bits = |h: &geom::Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    hits.iter().map(bits).collect()
}

/// A closed sphere round `centre`, of `rings` bands from pole to pole: triangles in random order, turned at random.
pub(crate) fn sphere(rings: u32, radius: f64, centre: Point) -> Animation {
    let around = 2 * rings;
    let at = |ring: u32, k: u32| match ring {
        0 => 0,
        _ if ring == rings => 1,
        _ => 2 + (ring - 1) * around + k % around,
    };
    let mut vertices = vec![[0.0; 3]; 2 + ((rings - 1) * around) as usize];
    let mut triangles = Vec::new();
    for (ring, k) in (0..=rings).flat_map(|ring| (0..around).map(move |k| (ring, k))) {
        let [down, along] = [ring, k].map(|i| PI * f64::from(i) / f64::from(rings));
        let unit = [
            down.sin() * along.cos(),
            down.cos(),
            down.sin() * along.sin(),
        ];
        let place = |i: usize| (f64::from(centre[i]) + radius * unit[i]) as f32;
        vertices[at(ring, k) as usize] = std::array::from_fn(place);
        if ring < rings {
            let [a, b] = [at(ring, k), at(ring, k + 1)];
            let [c, d] = [at(ring + 1, k), at(ring + 1, k + 1)];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    // At the poles.
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
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
    Animation::new(vec![vertices], triangles).unwrap()
}

/// A ball that is crushed; a triangle that comes late, one that shrinks to nothing, one that never is.
pub(crate) fn moving() -> Arc<Animation> {
    let ball = sphere(18, 1.0, [0.0; 3]);
    let mut triangles = ball.triangles().to_vec();
    let mut first = ball.first().to_vec();
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
