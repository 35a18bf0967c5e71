//! Compares `exact` on each device with the oracle, which shares no code with any device, on every ray.

use crate::pool::{self, Pooled};
use crate::scene_of;
use abvh::{
    Device, Hit, Hits, Intersector, Matrix, Mesh, MeshId, Point, Query, Ray, Source, Tracer,
};
use conformance::oracle::Oracle;
use conformance::stage::vertices;
use conformance::{Target, aimed};
use geom::Animation;
use integration::{is_full, number, share};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Demos and positions: a twisted cloth, and bodies that collide near the origin and far from it.
const SCENES: [(&str, Point); 3] = [
    ("demo:twist:2000", [0.0; 3]),
    ("demo:collide:2000", [0.0; 3]),
    ("demo:collide:2000", [3e4, -2e4, 1e4]),
];
/// Rays of a step at each kind of target, and total number of rays, in the full tier.
const RAYS: usize = 1024;
const ALL: usize = 10_000_000;
/// Distances of ray origins, in units of the scene's size, used in turn.
const DISTANCES: [f64; 4] = [0.6, 2.0, 100.0, 1e4];

/// Tests a streamed mesh with a static, a rigid and a key-framed one. `ABVH_CASES` is the number of steps per scene.
pub(crate) fn exact(device: &Device) {
    let steps = match is_full() {
        true => ALL.div_ceil(SCENES.len() * Target::ALL.len() * RAYS),
        false => 8,
    };
    let steps = number("ABVH_CASES", steps as u64);
    for (name, place) in SCENES {
        let mut stage = Stage::new(name, place, device);
        (0..steps).for_each(|number| stage.step(number as usize));
    }
}

/// The four meshes, all made from one demo.
struct Stage {
    demo: Arc<Animation>,
    /// The demo, translated to its position.
    keyed: Animation,
    place: Point,
    /// Triangles of all meshes.
    triangles: Vec<[u32; 3]>,
    live: Pooled,
    robot: MeshId,
    cloth: MeshId,
    /// Rigid part of each vertex of the robot.
    parts: Vec<u32>,
}

impl Stage {
    fn new(name: &str, place: Point, device: &Device) -> Self {
        let demo = scene::open(name, &scene::SceneOptions::default()).unwrap();
        let demo = demo.animation;
        let (rest, triangles) = (put(demo.first(), place), demo.triangles());
        let half = rest.len() / 2;
        let parts: Vec<u32> = (0..rest.len()).map(|v| u32::from(v > half)).collect();
        let keys = demo.all_keys().unwrap();
        let keys: Vec<_> = keys.iter().map(|key| put(key, place)).collect();
        let meshes = [
            Mesh::fixed(&rest, triangles),
            Mesh::rigid(demo.first(), triangles, &parts),
            Mesh::streamed(&rest, triangles),
            Mesh::keyframes(keys.clone(), triangles),
        ];
        let (scene, [_, robot, cloth, _]) = scene_of(meshes.map(Result::unwrap));
        let exact = Tracer::builder().intersector(Intersector::Exact);
        let first = |mesh| (mesh * rest.len()) as u32;
        let of_mesh = |first| triangles.iter().map(move |t| t.map(|v| first + v));
        Self {
            triangles: (0..4).map(first).flat_map(of_mesh).collect(),
            live: pool::build(exact, scene, device),
            keyed: Animation::new(keys, triangles.to_vec()).unwrap(),
            demo: Arc::clone(&demo),
            place,
            robot,
            cloth,
            parts,
        }
    }

    /// Moves three meshes far at once, and traces rays from all sides.
    fn step(&mut self, number: usize) {
        let phase = (0.618 * number as f64).fract();
        let cloth = put(&vertices(&self.demo, phase * self.demo.end()), self.place);
        let matrices = [0.0, 0.1].map(|ahead| turned(TAU * phase as f32 + ahead, self.place));
        let rest = self.demo.first();
        let each = rest.iter().zip(&self.parts);
        let robot = each.map(|(&p, &part)| moved(&matrices[part as usize], p));
        let robot = robot.collect();
        let time = (1.0 - phase) * self.demo.end();
        let keyed = vertices(&self.keyed, time);
        let all = [put(rest, self.place), robot, cloth, keyed].concat();
        let rays = self.rays(&all, number);
        let mut step = self.live.step(time);
        step.poses(self.robot, &matrices).unwrap();
        let cloth = Source::Host(&all[2 * rest.len()..3 * rest.len()]);
        step.vertices(self.cloth, cloth).unwrap();
        let [closest, any] = [Query::Closest, Query::Any].map(|q| step.trace(&rays, q).unwrap());
        let done = step.submit().unwrap();
        let hits = self.live.hits(done, closest).unwrap();
        let one = self.demo.triangle_count() as u32;
        let answer = |hit: Hit| Answer {
            triangle: hit.mesh.index() as u32 * one + hit.triangle,
            values: [hit.t, hit.u, hit.v].map(f32::to_bits),
        };
        let found: Vec<_> = (0..rays.len())
            .map(|i| hits.closest(i).map(answer))
            .collect();
        assert!(found.iter().flatten().count() > rays.len() / 2);
        let any = self.live.hits(done, any).unwrap();
        let corners = self.triangles.iter().map(|t| t.map(|v| all[v as usize]));
        let oracle = Oracle::new(corners.collect());
        let wrong = first_wrong(&oracle, &rays, (&found, any));
        assert_eq!(wrong, None, "step {number}");
    }

    /// Returns rays at different triangles in each step.
    fn rays(&self, all: &[Point], number: usize) -> Vec<Ray> {
        let mut triangles = self.triangles.clone();
        triangles.rotate_left(97 * number % self.triangles.len());
        let now = Animation::new(vec![all.to_vec()], triangles).unwrap();
        let distance = DISTANCES[number % DISTANCES.len()];
        let at = |target| aimed(&now, 0.0, target, distance, share(RAYS));
        Target::ALL.into_iter().flat_map(at).collect()
    }
}

/// A hit: triangle index over all meshes, and the bits of `t`, `u` and `v`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Answer {
    triangle: u32,
    values: [u32; 3],
}

/// Describes the first ray whose closest hit or any-hit answer is wrong.
fn first_wrong(
    oracle: &Oracle,
    rays: &[Ray],
    (closest, any): (&[Option<Answer>], Hits),
) -> Option<String> {
    (0..rays.len()).into_par_iter().find_map_first(|i| {
        let (ray, found, any) = (&rays[i], closest[i], any.is_hit(i));
        let expected = oracle.closest(ray);
        let exact = expected.map(|e| Answer {
            triangle: e.triangle,
            values: e.rounded.map(f32::to_bits),
        });
        let is_right = found == exact && any == expected.is_some();
        let text = || format!("{ray:?} hits {found:?} (any: {any}), expected {expected:?}");
        (!is_right).then(text)
    })
}

fn put(points: &[Point], place: Point) -> Vec<Point> {
    let moved = |p: &Point| std::array::from_fn(|i| p[i] + place[i]);
    points.iter().map(moved).collect()
}

/// Transforms a vertex of a rigid part by its [`Matrix`].
fn moved(matrix: &Matrix, v: Point) -> Point {
    matrix.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2] + r[3])
}

/// Returns a rotation about the vertical axis through the origin, then a translation.
fn turned(angle: f32, [x, y, z]: Point) -> Matrix {
    let (sin, cos) = angle.sin_cos();
    [[cos, 0.0, sin, x], [0.0, 1.0, 0.0, y], [-sin, 0.0, cos, z]]
}
