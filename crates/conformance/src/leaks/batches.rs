//! Batches: one closed body somewhere, and rays at it.

use super::LeakPlan;
use crate::generate::bodies::{BODIES, Body};
use crate::generate::{mixed, shares};
use fastrand::Rng;
use geom::{Animation, Point, Ray};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

named! {
    /// What a ray is aimed at.
    pub enum Aim {
        /// A point on an edge, as near as its coordinates can be.
        Edge = "an edge",
        /// A vertex.
        Vertex = "a vertex",
        /// Nothing in particular.
        Random = "random",
    }
}

/// Aims times sides. Rays of a batch take turns.
pub(crate) const SORTS: usize = 6;

/// The most rays of a batch: 32 MiB of them.
const MOST: u64 = 1 << 20;

/// One body at one place, and how many rays are aimed at it.
#[derive(Clone, Copy, Debug)]
pub(super) struct BatchSpec<'a> {
    pub(super) body: &'a Body,
    pub(super) offset: f32,
    pub(super) variant: u32,
    rays: u64,
    /// Its number among all batches.
    number: u64,
}

/// A closed body that stands still, and rays at it.
#[derive(Clone, Debug)]
pub struct RayBatch {
    /// The body.
    pub animation: Arc<Animation>,
    /// The rays.
    pub rays: Vec<Ray>,
}

impl RayBatch {
    /// What the `i`-th ray is aimed at, and whether it begins inside.
    #[must_use]
    pub fn sort(i: usize) -> (Aim, bool) {
        (Aim::ALL[i % 3], i % SORTS < 3)
    }
}

/// The bodies and rays of a plan, as [`super::run`] traces them, for those who judge by something else than parity.
#[must_use]
pub fn ray_batches(plan: &LeakPlan) -> Vec<RayBatch> {
    let specs = specs(plan, BODIES);
    specs.iter().map(|spec| spec.make(plan.seed)).collect()
}

/// Shares the rays out, so that each body at each offset gets as many as the next.
pub(super) fn specs<'a>(plan: &LeakPlan, bodies: &'a [Body]) -> Vec<BatchSpec<'a>> {
    let places = (plan.offsets.len() * bodies.len()) as u64;
    let variants = (plan.rays / places.max(1)).div_ceil(MOST).max(1);
    let mut specs = Vec::new();
    for (rays, number) in shares(plan.rays, places * variants).zip(0..) {
        let [variant, place] = [number % variants, number / variants];
        let (offset, body) = (place as usize / bodies.len(), place as usize % bodies.len());
        specs.push(BatchSpec {
            body: &bodies[body],
            offset: plan.offsets[offset],
            variant: variant as u32,
            rays,
            number,
        });
    }
    specs.retain(|spec| spec.rays > 0);
    specs
}

impl BatchSpec<'_> {
    pub(super) fn make(&self, seed: u64) -> RayBatch {
        let batch_seed = mixed(mixed(seed) ^ self.number);
        let moved = self.moved(&mut Rng::with_seed(batch_seed));
        // Each ray has a generator of its own, so that threads need not agree on anything.
        let ray = |i: u64| {
            let mut rng = Rng::with_seed(mixed(batch_seed ^ (i + 1)));
            moved.ray(i as usize, &mut rng)
        };
        let rays = (0..self.rays).into_par_iter().map(ray).collect();
        let animation = Animation::new(vec![moved.points], moved.triangles)
            .expect("bodies name their own vertices");
        RayBatch {
            animation: Arc::new(animation),
            rays,
        }
    }

    /// Every second variant keeps its axes, so that flat faces stay flat.
    fn moved(&self, rng: &mut Rng) -> Moved<'_> {
        let (points, mut triangles) = (self.body.shape)();
        rng.shuffle(&mut triangles);
        triangles.iter_mut().for_each(|t| rng.shuffle(t));
        let angles = match self.variant.is_multiple_of(2) {
            true => [0.0; 2],
            false => [(); 2].map(|()| TAU * rng.f64()),
        };
        let centre = std::array::from_fn(|_| {
            let sign = if rng.bool() { 1.0 } else { -1.0 };
            sign * (f64::from(self.offset) + rng.f64())
        });
        let mut moved = Moved {
            shape: self.body,
            points: Vec::new(),
            triangles,
            rotation: rotation(angles),
            centre,
        };
        let place = |p: Point| moved.place(p.map(f64::from));
        moved.points = points.into_iter().map(place).collect();
        moved
    }
}

/// A body turned, moved and shuffled.
struct Moved<'a> {
    shape: &'a Body,
    points: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// Rows of a rotation.
    rotation: [[f64; 3]; 3],
    centre: [f64; 3],
}

impl Moved<'_> {
    /// From the body's own space to the scene's.
    fn place(&self, p: [f64; 3]) -> Point {
        std::array::from_fn(|i| {
            let turned: f64 = (0..3).map(|k| self.rotation[i][k] * p[k]).sum();
            (turned + self.centre[i]) as f32
        })
    }

    /// The `i`-th ray at the body.
    fn ray(&self, i: usize, rng: &mut Rng) -> Ray {
        let (aim, inside) = RayBatch::sort(i);
        let radius = self.shape.radius;
        let origin = if inside {
            self.place((self.shape.inner)(rng))
        } else {
            let far = radius * (1.5 + 2.0 * rng.f64());
            self.place(sphere(rng).map(|x| x * far))
        };
        let vertex = |i: u32| self.points[i as usize];
        let corners = self.triangles[rng.usize(..self.triangles.len())];
        let k = rng.usize(..3);
        let at: Point = match aim {
            Aim::Vertex => vertex(corners[k]),
            Aim::Edge => {
                let (a, b, s) = (vertex(corners[k]), vertex(corners[(k + 1) % 3]), rng.f32());
                std::array::from_fn(|i| a[i] + s * (b[i] - a[i]))
            }
            Aim::Random if inside => {
                let far = sphere(rng);
                std::array::from_fn(|i| origin[i] + (far[i] * radius) as f32)
            }
            Aim::Random => {
                let reach = radius * rng.f64();
                self.place(sphere(rng).map(|x| x * reach))
            }
        };
        Ray::new(origin, std::array::from_fn(|i| at[i] - origin[i]))
    }
}

/// About the third axis, then about the first.
fn rotation([a, b]: [f64; 2]) -> [[f64; 3]; 3] {
    let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
    [
        [ca, -sa, 0.0],
        [cb * sa, cb * ca, -sb],
        [sb * sa, sb * ca, cb],
    ]
}

/// A direction of length 1, all alike.
fn sphere(rng: &mut Rng) -> [f64; 3] {
    let z = 2.0 * rng.f64() - 1.0;
    let (sin, cos) = (TAU * rng.f64()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    [r * cos, r * sin, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaks::OFFSETS;
    use backend::Method;
    use geom::is_degenerate;

    fn plan(rays: u64) -> LeakPlan {
        LeakPlan {
            seed: 3,
            rays,
            offsets: OFFSETS.to_vec(),
            method: Method::default(),
        }
    }

    #[test]
    fn batches_share_out_every_ray_among_bodies_that_keep_their_area() {
        for rays in [0, 1, 7, 16, 1000, 40_000_001] {
            let specs = specs(&plan(rays), BODIES);
            assert_eq!(specs.iter().map(|l| l.rays).sum::<u64>(), rays);
            assert!(specs.iter().all(|l| l.rays <= MOST + 1));
            for spec in specs {
                let moved = spec.moved(&mut Rng::with_seed(spec.number));
                let corners = |t: &[u32; 3]| t.map(|v| moved.points[v as usize]);
                let mut all = moved.triangles.iter().map(corners);
                assert!(!all.any(|c| is_degenerate(&c)));
            }
        }
    }

    #[test]
    fn rays_depend_on_seed_batch_and_number_alone() {
        let plan = plan(160);
        let specs = specs(&plan, BODIES);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let first = specs[3].make(9).rays;
        let again = one.unwrap().install(|| specs[3].make(9).rays);
        assert_eq!(first, again);
        assert_ne!(first, specs[3].make(10).rays);
        assert_ne!(first[..5], specs[4].make(9).rays[..5]);
    }
}
