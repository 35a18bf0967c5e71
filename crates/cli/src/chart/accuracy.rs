//! Counts how often the triangle of a contender's hit differs from the exact one.
//!
//! *Plain* rays come from a camera or are random. *Aimed* rays are directed at edges and vertices.

use crate::error::CliError;
use crate::measure::{Contender, LoadedScene};
use crate::tracer_settings::TracerSettings;
use backend::{BackendName, Hits, Intersector, Policy, Query, QueryKind, Rays};
use conformance::oracle::Oracle;
use fastrand::Rng;
use geom::{Aabb, Animation, Hit, Moment, Point, Ray, is_active};
use output::plot::ChartPoint;
use rayon::prelude::*;
use scene::Viewpoint;
use std::sync::Arc;

/// Number of sample times in a scene's motion at which rays are traced.
const SAMPLE_TIMES: usize = 4;
/// Maximum number of rays that are traced at a time.
const MOST: usize = 1 << 20;

/// Rays that are traced together, with their reference answers.
struct AnsweredBatch {
    time: f64,
    rays: Vec<Ray>,
    /// Whether the rays are aimed at edges and vertices.
    is_aimed: bool,
    /// Closest triangle of each ray, by exact arithmetic.
    closest: Vec<Option<u32>>,
    /// For each ray, 1 if `exact` on the host finds its hit in shadow, else 0. Empty for aimed rays.
    blocked: Vec<u8>,
}

/// The rays of a scene with their reference answers.
pub(super) struct AnsweredRays<'a> {
    animation: &'a Arc<Animation>,
    light: Point,
    batches: Vec<AnsweredBatch>,
}

impl<'a> AnsweredRays<'a> {
    /// Generates `count` plain rays and a quarter as many aimed rays, and computes their answers.
    pub(super) fn new(
        animation: &'a Arc<Animation>,
        view: Viewpoint,
        count: usize,
    ) -> Result<Self, CliError> {
        let times = sample_times(animation, SAMPLE_TIMES);
        let count = count.div_ceil(times.len());
        let mut batches = Vec::new();
        for time in times {
            let oracle = Oracle::at(&animation.at(time).map_err(CliError::invalid)?);
            let kinds = rays_at(animation, &view, time, count);
            for (all, is_aimed) in kinds.iter().zip([false, true]) {
                batches.extend(all.chunks(MOST).map(|rays| {
                    AnsweredBatch {
                        time,
                        rays: rays.to_vec(),
                        is_aimed,
                        closest: rays
                            .par_iter()
                            .map(|r| oracle.closest_triangle(r))
                            .collect(),
                        blocked: Vec::new(),
                    }
                }));
            }
        }
        // Shadows are compared with those of `exact` on the host, over fresh trees.
        let tracer = TracerSettings::of(
            Some(BackendName::Cpu),
            Intersector::Exact,
            Some(Policy::Rebuild),
        );
        let mut reference = LoadedScene::load(&Contender::Ours(tracer), animation)?;
        let light = view.light;
        for batch in batches.iter_mut().filter(|batch| !batch.is_aimed) {
            batch.blocked = batch.trace(&mut reference, light)?.blocked;
        }
        Ok(Self {
            animation,
            light,
            batches,
        })
    }

    /// Traces all rays by one contender, and counts wrong answers.
    pub(super) fn compare(
        &self,
        contender: &Contender,
        point: &mut ChartPoint,
    ) -> Result<(), CliError> {
        let mut loaded = LoadedScene::load(contender, self.animation)?;
        // Trace an empty list of rays at time 0. This builds the first tree at the beginning of the motion.
        let none = Query {
            rays: Rays::List(&[]),
            kind: QueryKind::Closest,
        };
        loaded.trace(0.0, none)?;
        for batch in &self.batches {
            let hits = batch.trace(&mut loaded, self.light)?;
            batch.count(&hits, point);
        }
        Ok(())
    }
}

impl AnsweredBatch {
    fn trace(&self, loaded: &mut LoadedScene, light: Point) -> Result<Hits, CliError> {
        let kind = if self.is_aimed {
            QueryKind::Closest
        } else {
            QueryKind::ClosestAndShadow { light }
        };
        let rays = Rays::List(&self.rays);
        loaded.trace(self.time, Query { rays, kind })
    }

    /// Counts wrong answers.
    fn count(&self, hits: &Hits, point: &mut ChartPoint) {
        for (i, (truth, hit)) in self.closest.iter().zip(&hits.closest).enumerate() {
            let is_wrong = truth.unwrap_or(Hit::MISS.triangle) != hit.triangle;
            if self.is_aimed {
                point.aimed.rays += 1;
                point.aimed.wrong += u64::from(is_wrong);
                continue;
            }
            point.rays_tested += 1;
            point.wrong += u64::from(is_wrong);
            let shadows = [self.blocked.get(i), hits.blocked.get(i)];
            point.wrong_shadow += u64::from(!is_wrong && shadows[0] != shadows[1]);
        }
    }
}

/// Size of the region in which aimed and random rays begin, relative to the scene's box.
const ORIGIN_SCALE: f64 = 2.0;
/// Maximum number of random triangles that are tried to find an active one to aim at.
const DRAWS: usize = 64;

/// Returns the middle of each of `count` equal parts of the motion, or one time if there is one key frame.
fn sample_times(animation: &Animation, count: usize) -> Vec<f64> {
    let end = animation.end();
    let count = if end > 0.0 { count } else { 1 };
    let at = |i: usize| end * (i as f64 + 0.5) / count as f64;
    (0..count).map(at).collect()
}

/// Returns `count` plain rays, half from a camera and half random, and a quarter as many aimed rays.
fn rays_at(animation: &Animation, view: &Viewpoint, time: f64, count: usize) -> [Vec<Ray>; 2] {
    let mut rng = Rng::with_seed(time.to_bits());
    let bounds = animation.bounds();
    let mut plain = of_camera(view, count / 2);
    plain.resize_with(count, || at_random(&bounds, &mut rng));
    let moment = animation.at(time);
    let aim = |_| aimed(moment.as_ref().ok()?, &bounds, &mut rng);
    [plain, (0..count / 4).filter_map(aim).collect()]
}

/// Returns the first `count` rays of a camera of about that many pixels, row by row. Empty if the view defines no
/// camera.
fn of_camera(view: &Viewpoint, count: usize) -> Vec<Ray> {
    let width = (count as f64 * 1.6).sqrt().ceil().max(1.0) as u32;
    let height = count.div_ceil(width as usize).max(1) as u32;
    let camera = view.camera([width, height]);
    camera.map_or_else(Vec::new, |c| c.rays().take(count).collect())
}

/// Returns a ray from a random point around the box to a random point in the box.
fn at_random(bounds: &Aabb, rng: &mut Rng) -> Ray {
    let from = within(bounds, ORIGIN_SCALE, rng);
    towards(from, within(bounds, 1.0, rng))
}

/// Returns a ray from a random point around the box to a vertex, or to a rounded point on an edge.
fn aimed(moment: &Moment<'_>, bounds: &Aabb, rng: &mut Rng) -> Option<Ray> {
    let count = u32::try_from(moment.animation().triangle_count()).ok()?;
    let mut draw = || (count > 0).then(|| moment.corners(rng.u32(..count)));
    let corners = (0..DRAWS).find_map(|_| draw().filter(is_active))?;
    let k = rng.usize(..3);
    let (a, b) = (corners[k], corners[(k + 1) % 3]);
    let s = if rng.bool() { 0.0 } else { rng.f32() };
    let at = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]));
    Some(towards(within(bounds, ORIGIN_SCALE, rng), at))
}

fn towards(from: Point, to: Point) -> Ray {
    Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
}

/// Returns a random point in the box scaled about its centre, or the origin if the box is empty.
fn within(bounds: &Aabb, by: f64, rng: &mut Rng) -> Point {
    if bounds.is_empty() {
        return [0.0; 3];
    }
    std::array::from_fn(|i| {
        let [low, high] = [bounds.min[i], bounds.max[i]].map(f64::from);
        let half = 0.5 * (high - low) * by;
        (f64::midpoint(low, high) + half * (2.0 * rng.f64() - 1.0)) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(triangle: u32) -> Hit {
        Hit {
            t: 1.0,
            triangle,
            ..Hit::MISS
        }
    }

    #[test]
    fn counts_each_kind_of_error() {
        let batch = |is_aimed, closest: &[Option<u32>]| AnsweredBatch {
            time: 0.0,
            rays: Vec::new(),
            is_aimed,
            closest: closest.to_vec(),
            blocked: [vec![1], vec![0; closest.len() - 1]].concat(),
        };
        let found = |closest: &[Hit]| Hits {
            closest: closest.to_vec(),
            blocked: vec![0; closest.len()],
        };
        let [right, other] = [hit(1), hit(2)];
        let plain = [right, right, Hit::MISS, right, other];
        let truth = [Some(1), Some(1), None, None, Some(1)];
        let mut point = ChartPoint::default();
        batch(false, &truth).count(&found(&plain), &mut point);
        let aimed = batch(true, &[Some(1), None]);
        aimed.count(&found(&[Hit::MISS; 2]), &mut point);
        assert_eq!((point.rays_tested, point.wrong), (5, 2));
        assert_eq!(point.wrong_shadow, 1);
        assert_eq!((point.aimed.rays, point.aimed.wrong), (2, 1));
    }

    #[test]
    fn rays_are_valid_and_reproducible() {
        let scene = scene::open("demo:collide:300", &scene::SceneOptions::default()).unwrap();
        let a = &scene.animation;
        let view = Viewpoint::framing(a, 40.0, [64, 40]);
        let rays = rays_at(a, &view, 1.5, 1000).concat();
        assert!(rays.len() == 1250 && rays.iter().all(Ray::is_valid));
        let from_eye = rays.iter().filter(|r| r.origin == view.eye);
        assert_eq!(from_eye.count(), 500);
        assert!(rays == rays_at(a, &view, 1.5, 1000).concat(), "same seed");
    }

    #[test]
    fn sample_times_lie_inside_the_animation() {
        let key = |x| vec![[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of = |keys| Animation::new(keys, vec![[0, 1, 2]]).unwrap();
        let moving = of(vec![key(0.0), key(1.0), key(2.0)]);
        assert_eq!(sample_times(&moving, 2), [0.5, 1.5]);
        assert_eq!(sample_times(&of(vec![key(0.0)]), 2), [0.0]);
    }

    #[test]
    fn inactive_scenes_get_no_aimed_rays() {
        let nothing = Animation::new(vec![vec![[f32::NAN; 3]]], vec![[0; 3]]).unwrap();
        let view = Viewpoint::framing(&nothing, 40.0, [64, 40]);
        let counts = rays_at(&nothing, &view, 0.0, 100).map(|rays| rays.len());
        assert_eq!(counts, [100, 0]);
    }
}
