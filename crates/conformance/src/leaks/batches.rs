//! Batches: one body somewhere, and rays at it.

use super::LeakPlan;
use super::aim;
use super::bodies::Body;
use fastrand::Rng;
use geom::{Animation, Point, Ray};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The most rays of a batch: 32 MiB of them.
const MOST: u64 = 1 << 20;

/// One body at one place, and how many rays it is asked.
#[derive(Clone, Copy, Debug)]
pub(super) struct BatchSpec<'a> {
    pub(super) body: &'a Body,
    pub(super) offset: f32,
    pub(super) variant: u32,
    rays: u64,
    /// Its number among all batches.
    number: u64,
}

/// A batch ready to be asked.
pub(super) struct Made<'a> {
    pub(super) spec: &'a BatchSpec<'a>,
    pub(super) animation: Arc<Animation>,
    pub(super) rays: Vec<Ray>,
}

/// A body turned, moved and shuffled.
pub(super) struct Moved<'a> {
    pub(super) shape: &'a Body,
    pub(super) points: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Rows of a rotation.
    rotation: [[f64; 3]; 3],
    centre: [f64; 3],
}

/// Shares the rays out, so that each body at each offset gets as many as the next.
pub(super) fn specs<'a>(plan: &LeakPlan, bodies: &'a [Body]) -> Vec<BatchSpec<'a>> {
    let places = (plan.offsets.len() * bodies.len()) as u64;
    let variants = (plan.rays / places.max(1)).div_ceil(MOST).max(1);
    let total = places * variants;
    let share = |n: u64| (u128::from(plan.rays) * u128::from(n) / u128::from(total)) as u64;
    let mut specs = Vec::new();
    for &offset in &plan.offsets {
        for body in bodies {
            for variant in 0..variants as u32 {
                let number = specs.len() as u64;
                specs.push(BatchSpec {
                    body,
                    offset,
                    variant,
                    rays: share(number + 1) - share(number),
                    number,
                });
            }
        }
    }
    specs.retain(|spec| spec.rays > 0);
    specs
}

impl BatchSpec<'_> {
    pub(super) fn make(&self, seed: u64) -> Made<'_> {
        let batch_seed = mixed(mixed(seed) ^ self.number);
        let moved = self.moved(&mut Rng::with_seed(batch_seed));
        // Each ray has a generator of its own, so that threads need not agree on anything.
        let ray = |i: u64| {
            let mut rng = Rng::with_seed(mixed(batch_seed ^ (i + 1)));
            aim::ray(&moved, i as usize, &mut rng)
        };
        let rays = (0..self.rays).into_par_iter().map(ray).collect();
        let animation = Animation::new(vec![moved.points], moved.triangles)
            .expect("bodies name their own vertices");
        Made {
            spec: self,
            animation: Arc::new(animation),
            rays,
        }
    }

    /// Every second variant keeps its axes, so that flat faces stay flat.
    fn moved(&self, rng: &mut Rng) -> Moved<'_> {
        let (points, mut triangles) = (self.body.shape)();
        rng.shuffle(&mut triangles);
        triangles.iter_mut().for_each(|t| rng.shuffle(t));
        let angles = if self.variant.is_multiple_of(2) {
            [0.0; 2]
        } else {
            [(); 2].map(|()| TAU * rng.f64())
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
        moved.points = points
            .into_iter()
            .map(|p| moved.place(p.map(f64::from)))
            .collect();
        moved
    }
}

impl Moved<'_> {
    /// From the body's own space to the scene's.
    pub(super) fn place(&self, p: [f64; 3]) -> Point {
        std::array::from_fn(|i| {
            let turned: f64 = (0..3).map(|k| self.rotation[i][k] * p[k]).sum();
            (turned + self.centre[i]) as f32
        })
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

/// A number at random that depends on `x` alone.
fn mixed(x: u64) -> u64 {
    Rng::with_seed(x).u64(..)
}

#[cfg(test)]
mod tests {
    use super::super::bodies::BODIES;
    use super::*;
    use backend::Method;
    use geom::is_degenerate;

    fn plan(rays: u64) -> LeakPlan {
        LeakPlan {
            seed: 3,
            rays,
            offsets: super::super::OFFSETS.to_vec(),
            method: Method::default(),
        }
    }

    #[test]
    fn lots_share_out_every_ray() {
        for rays in [0, 1, 7, 16, 1000, 40_000_001] {
            let specs = specs(&plan(rays), BODIES);
            assert_eq!(specs.iter().map(|l| l.rays).sum::<u64>(), rays);
            assert!(specs.iter().all(|l| l.rays <= MOST + 1));
        }
    }

    #[test]
    fn bodies_keep_all_their_area_wherever_they_are_moved() {
        let plan = plan(40_000_000);
        for spec in specs(&plan, BODIES) {
            let moved = spec.moved(&mut Rng::with_seed(spec.number));
            let corners = |t: &[u32; 3]| t.map(|v| moved.points[v as usize]);
            assert!(
                !moved
                    .triangles
                    .iter()
                    .map(corners)
                    .any(|c| is_degenerate(&c))
            );
        }
    }

    #[test]
    fn rays_depend_on_seed_lot_and_number_alone() {
        let plan = plan(160);
        let specs = specs(&plan, BODIES);
        let one = || {
            rayon::ThreadPoolBuilder::new()
                .num_threads(1)
                .build()
                .unwrap()
        };
        let [first, again] = [
            specs[3].make(9).rays,
            one().install(|| specs[3].make(9).rays),
        ];
        assert_eq!(first, again);
        assert_ne!(first, specs[3].make(10).rays);
        assert_ne!(first[..5], specs[4].make(9).rays[..5]);
    }
}
