//! Counts how often a method's hits differ from exact answers.
//!
//! *Plain* rays come from a camera or are random. *Aimed* rays are directed at edges and vertices.
//!
//! Sampling is sequential. After each stage, only methods whose 95 % interval overlaps that of another intersector
//! trace more rays. Intervals are Wilson's, or follow the rule of three if no answer was wrong ([`Rate`]).

use super::plan::HitMethod;
use crate::devices::Opening;
use crate::error::CliError;
use crate::measure::{Contender, LoadedScene};
use crate::tracer_settings::TracerSettings;
use backend::{BackendName, Hits, Intersector, Policy, QueryKind};
use conformance::oracle::Oracle;
use fastrand::Rng;
use geom::{Aabb, Animation, Hit, Moment, Point, Ray, is_active};
use output::plot::{self, Rate};
use rayon::prelude::*;
use scene::Viewpoint;
use std::ops::Range;
use std::sync::Arc;

/// Number of sample times in a scene's motion at which rays are traced.
const MOMENTS: usize = 4;
/// Maximum number of rays that are traced at a time.
const MOST: usize = 1 << 20;
/// Stages of the sampling. A ray belongs to the stage that contains its number modulo 8: first an eighth of the rays,
/// then three eighths, then the other half. So the stages of a scene are the same on every machine.
pub(super) const STAGES: [Range<usize>; 3] = [0..1, 1..4, 4..8];
/// Number of plain rays of a probe at each of two times.
const PROBE: usize = 1 << 10;

/// Generates and traces the rays of a scene.
pub(super) struct RaySampler<'a> {
    pub(super) animation: &'a Arc<Animation>,
    pub(super) view: Viewpoint,
    /// Number of plain rays in all stages.
    pub(super) rays: usize,
}

/// Rays that are traced together, without answers.
struct RayBatch {
    time: f64,
    rays: Vec<Ray>,
    /// Whether the rays are aimed at edges and vertices.
    is_aimed: bool,
}

/// A batch with its reference answers.
struct AnsweredBatch {
    batch: RayBatch,
    /// Triangles by exact arithmetic.
    closest: Vec<Option<u32>>,
    /// Shadows by the reference: 1 where the hit is in shadow. Empty for aimed rays.
    blocked: Vec<u8>,
}

/// The reference answers of one stage, which all methods share.
pub(super) struct AnsweredStage(Vec<AnsweredBatch>);

/// One method on one backend, with its counts so far.
pub(super) struct Tally {
    /// The contender that traces the rays.
    pub(super) contender: Contender,
    /// Index of the group of contenders that give the same answers.
    pub(super) group: usize,
    /// Whether the next stage traces plain rays, and whether it traces aimed rays.
    goes_on: [bool; 2],
    counted: plot::ChartPoint,
}

impl RaySampler<'_> {
    /// Traces a few plain and aimed rays.
    pub(super) fn probe(&self, loaded: &mut LoadedScene) -> Result<Vec<Hits>, CliError> {
        let mut batches = Vec::new();
        for time in moments(self.animation, 2) {
            let [plain, aimed] = rays_at(self.animation, &self.view, time, PROBE);
            let rays = [plain, aimed].concat();
            batches.push((time, rays));
        }
        let lists = batches.iter().map(|(time, rays)| (*time, &rays[..]));
        loaded.trace_lists(self.kind(false), lists)
    }

    /// Returns the rays of a stage. `kinds` selects the kinds of rays: plain, aimed. The rays do not depend on other
    /// stages.
    fn batches(&self, stage: &Range<usize>, kinds: [bool; 2]) -> Vec<RayBatch> {
        let moments = moments(self.animation, MOMENTS);
        let count = self.rays.div_ceil(moments.len());
        let modulus = STAGES[STAGES.len() - 1].end;
        let mut batches = Vec::new();
        for time in moments {
            let all = rays_at(self.animation, &self.view, time, count);
            for (rays, is_aimed) in all.into_iter().zip([false, true]) {
                if !kinds[usize::from(is_aimed)] {
                    continue;
                }
                let numbered = rays.into_iter().enumerate();
                let here = numbered.filter(|(i, _)| stage.contains(&(i % modulus)));
                let here: Vec<Ray> = here.map(|(_, ray)| ray).collect();
                batches.extend(here.chunks(MOST).map(|rays| RayBatch {
                    time,
                    is_aimed,
                    rays: rays.to_vec(),
                }));
            }
        }
        batches
    }

    /// Computes exact answers for the rays of a stage. Omits kinds of rays that no method traces any more.
    pub(super) fn answer(
        &self,
        stage: &Range<usize>,
        tallies: &[Tally],
    ) -> Result<AnsweredStage, CliError> {
        let kinds = [0, 1].map(|kind| tallies.iter().any(|tally| tally.goes_on[kind]));
        let mut oracle: Option<(f64, Oracle)> = None;
        let mut all = Vec::new();
        for batch in self.batches(stage, kinds) {
            let moment = self.animation.at(batch.time).map_err(CliError::invalid)?;
            let known = oracle.take().filter(|(time, _)| *time == batch.time);
            let (_, of_moment) =
                oracle.insert(known.unwrap_or_else(|| (batch.time, Oracle::at(&moment))));
            let rays = batch.rays.par_iter();
            all.push(AnsweredBatch {
                closest: rays.map(|ray| of_moment.closest_triangle(ray)).collect(),
                blocked: Vec::new(),
                batch,
            });
        }
        // Shadows are compared with those of `exact` on the host, over fresh trees.
        let tracer = TracerSettings::of(
            Some(BackendName::Cpu),
            Intersector::Exact,
            Some(Policy::Rebuild),
        );
        let host = Contender::Ours(tracer);
        let mut reference = LoadedScene::load(&host, self.animation, Opening::default())?;
        for answered in all.iter_mut().filter(|answered| !answered.batch.is_aimed) {
            answered.blocked = self.trace(&mut reference, &answered.batch)?.blocked;
        }
        Ok(AnsweredStage(all))
    }

    fn kind(&self, is_aimed: bool) -> QueryKind {
        let light = self.view.light;
        if is_aimed {
            QueryKind::Closest
        } else {
            QueryKind::ClosestAndShadow { light }
        }
    }

    fn trace(&self, loaded: &mut LoadedScene, batch: &RayBatch) -> Result<Hits, CliError> {
        let list = [(batch.time, &batch.rays[..])];
        let mut hits = loaded.trace_lists(self.kind(batch.is_aimed), list)?;
        hits.pop()
            .ok_or_else(|| CliError::failed("a trace has no result"))
    }

    /// Traces the rays of a stage by one method, and counts wrong answers.
    pub(super) fn compare(
        &self,
        loaded: &mut LoadedScene,
        stage: &AnsweredStage,
        tally: &mut Tally,
    ) -> Result<(), CliError> {
        // Trace an empty list of rays at time 0, so that the first tree is built at the beginning of the motion.
        loaded.trace_lists(QueryKind::Closest, [(0.0, &[][..])])?;
        for answered in &stage.0 {
            if tally.goes_on[usize::from(answered.batch.is_aimed)] {
                let hits = self.trace(loaded, &answered.batch)?;
                count(answered, &hits, &mut tally.counted);
            }
        }
        Ok(())
    }
}

impl Tally {
    pub(super) fn new(contender: Contender, group: usize) -> Self {
        Self {
            contender,
            group,
            goes_on: [true; 2],
            counted: plot::ChartPoint::default(),
        }
    }

    /// Returns whether the next stage traces rays of any kind.
    pub(super) fn is_going(&self) -> bool {
        self.goes_on.contains(&true)
    }

    /// Returns the rates of wrong answers so far, of plain rays and of aimed rays.
    fn rates(&self) -> [Option<Rate>; 2] {
        let (plain, aimed) = (&self.counted, &self.counted.aimed);
        [
            Rate::of(plain.wrong, plain.rays_tested),
            Rate::of(aimed.wrong, aimed.rays),
        ]
    }

    /// Copies the counts to a point.
    pub(super) fn write(&self, point: &mut plot::ChartPoint) {
        point.rays_tested = self.counted.rays_tested;
        point.wrong = self.counted.wrong;
        point.wrong_shadow = self.counted.wrong_shadow;
        point.aimed = self.counted.aimed;
    }
}

/// Decides which methods the next stage traces. A method continues with a kind of rays while its interval overlaps that
/// of another intersector on the same backend. A method without competing intersectors continues to the end.
pub(super) fn decide(tallies: &mut [Tally]) {
    let rates: Vec<_> = tallies
        .iter()
        .map(|tally| (HitMethod::of(&tally.contender), tally.rates()))
        .collect();
    for tally in tallies {
        let method = HitMethod::of(&tally.contender);
        let is_competitor = |other: &&(HitMethod, [Option<Rate>; 2])| method.competes_with(other.0);
        let competitors: Vec<_> = rates.iter().filter(is_competitor).collect();
        let own = tally.rates();
        for (kind, goes_on) in tally.goes_on.iter_mut().enumerate() {
            let overlaps = |other: &Option<Rate>| match (own[kind], other) {
                (Some(own), Some(other)) => own.low <= other.high && other.low <= own.high,
                _ => true,
            };
            let is_open =
                competitors.is_empty() || competitors.iter().any(|other| overlaps(&other.1[kind]));
            *goes_on = *goes_on && is_open;
        }
    }
}

/// Counts wrong answers.
fn count(answered: &AnsweredBatch, hits: &Hits, point: &mut plot::ChartPoint) {
    for (i, (truth, hit)) in answered.closest.iter().zip(&hits.closest).enumerate() {
        let is_wrong = truth.unwrap_or(Hit::MISS.triangle) != hit.triangle;
        if answered.batch.is_aimed {
            point.aimed.rays += 1;
            point.aimed.wrong += u64::from(is_wrong);
            continue;
        }
        point.rays_tested += 1;
        point.wrong += u64::from(is_wrong);
        let shadows = [answered.blocked.get(i), hits.blocked.get(i)];
        point.wrong_shadow += u64::from(!is_wrong && shadows[0] != shadows[1]);
    }
}

/// Size of the region in which aimed and random rays begin, relative to the scene's box.
const ORIGIN_SCALE: f64 = 2.0;
/// Maximum number of random triangles that are tried to find an active one to aim at.
const DRAWS: usize = 64;

/// Returns the middle of each of `count` equal parts of the motion, or one time if nothing moves.
fn moments(animation: &Animation, count: usize) -> Vec<f64> {
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
            batch: RayBatch {
                time: 0.0,
                rays: vec![Ray::new([0.0; 3], [1.0; 3]); closest.len()],
                is_aimed,
            },
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
        let mut point = plot::ChartPoint::default();
        count(&batch(false, &truth), &found(&plain), &mut point);
        let aimed = batch(true, &[Some(1), None]);
        count(&aimed, &found(&[Hit::MISS; 2]), &mut point);
        assert_eq!((point.rays_tested, point.wrong), (5, 2));
        assert_eq!(point.wrong_shadow, 1);
        assert_eq!((point.aimed.rays, point.aimed.wrong), (2, 1));
    }

    fn contender(backend: BackendName, intersector: Intersector) -> Contender {
        Contender::Ours(TracerSettings::of(
            Some(backend),
            intersector,
            Some(Policy::Refit),
        ))
    }

    fn tally(intersector: Intersector, [wrong, aimed]: [u64; 2]) -> Tally {
        let mut tally = Tally::new(contender(BackendName::Cpu, intersector), 0);
        (tally.counted.rays_tested, tally.counted.wrong) = (1_000_000, wrong);
        tally.counted.aimed = plot::Aimed {
            rays: 1000,
            wrong: aimed,
        };
        tally
    }

    #[test]
    fn overlapping_intervals_request_more_rays() {
        use Intersector::{Exact, MollerTrumbore, Watertight, Woop};
        let mut all = [
            tally(MollerTrumbore, [31, 200]),
            tally(Woop, [29, 190]),
            tally(Watertight, [2, 100]),
            tally(Exact, [0, 0]),
        ];
        decide(&mut all);
        // Two pairs are close. Aimed rays distinguish all but the first two.
        let goes_on: Vec<_> = all.iter().map(|t| t.goes_on).collect();
        let (both, plain) = ([true, true], [true, false]);
        assert_eq!(goes_on, [both, both, plain, plain]);
        // A method that has stopped does not continue, and another backend is no rival.
        all[1].counted.wrong = 90;
        all[3].contender = contender(BackendName::Wgpu, Exact);
        decide(&mut all);
        let goes_on: Vec<_> = all.iter().map(|t| t.goes_on).collect();
        let aimed = [false, true];
        assert_eq!(goes_on, [aimed, aimed, [false; 2], plain]);
    }

    #[test]
    fn stages_partition_the_rays() {
        let scene = scene::open("demo:collide:300", &scene::SceneOptions::default()).unwrap();
        let sampler = RaySampler {
            animation: &scene.animation,
            view: Viewpoint::framing(&scene.animation, 40.0, [64, 40]),
            rays: 1000,
        };
        let rays = |stage: &Range<usize>| -> Vec<Ray> {
            let batches = sampler.batches(stage, [true; 2]);
            batches.into_iter().flat_map(|batch| batch.rays).collect()
        };
        let all = rays(&(0..STAGES[STAGES.len() - 1].end));
        let staged: Vec<Vec<Ray>> = STAGES.iter().map(rays).collect();
        assert_eq!(staged.iter().map(Vec::len).sum::<usize>(), all.len());
        let is_in = |ray: &&Ray| staged.iter().filter(|s| s.contains(ray)).count() == 1;
        assert!(all.iter().filter(is_in).count() > 1200, "{}", all.len());
        assert!(sampler.batches(&STAGES[0], [false; 2]).is_empty());
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
        assert!(rays == rays_at(a, &view, 1.5, 1000).concat(), "made again");
    }

    #[test]
    fn moments_lie_inside_the_animation() {
        let key = |x| vec![[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of = |keys| Animation::new(keys, vec![[0, 1, 2]]).unwrap();
        let moving = of(vec![key(0.0), key(1.0), key(2.0)]);
        assert_eq!(moments(&moving, 2), [0.5, 1.5]);
        assert_eq!(moments(&of(vec![key(0.0)]), 2), [0.0]);
    }

    #[test]
    fn inactive_scenes_get_no_aimed_rays() {
        let nothing = Animation::new(vec![vec![[f32::NAN; 3]]], vec![[0; 3]]).unwrap();
        let view = Viewpoint::framing(&nothing, 40.0, [64, 40]);
        let counts = rays_at(&nothing, &view, 0.0, 100).map(|rays| rays.len());
        assert_eq!(counts, [100, 0]);
    }
}
