//! Rays of a scene with their exact answers; how often a way is wrong, and how far off where it is right.

use crate::args::{BackendName, ChartArgs, IntersectorName, LayoutName, MethodArgs, UpdateName};
use crate::bench;
use crate::choose::Ask;
use crate::session;
use crate::stop::Stop;
use backend::{Hits, QueryKind};
use conformance::oracle::Oracle;
use fastrand::Rng;
use geom::{Aabb, Animation, Hit, Moment, Point, Ray, is_active};
use output::plot::{self, TError};
use rayon::prelude::*;
use shading::View;
use std::iter;
use std::sync::Arc;

/// Moments of a scene at which it is traced.
const MOMENTS: usize = 4;
/// The most rays that are traced at a time.
const MOST: usize = 1 << 20;

pub(super) struct GroundTruth {
    light: Point,
    sheets: Vec<Sheet>,
}

/// Rays that are traced at a time.
struct Sheet {
    time: f64,
    rays: Vec<Ray>,
    /// Whether they are aimed at edges and vertices.
    is_aimed: bool,
    /// By exact arithmetic: the triangle and the distance.
    closest: Vec<Option<(u32, f64)>>,
    /// By the reference: 1 where the hit is in shadow.
    blocked: Vec<u8>,
}

impl GroundTruth {
    pub(super) fn of(animation: &Arc<Animation>, args: &ChartArgs) -> Result<Self, Stop> {
        let view = shading::frame_scene(animation, bench::FOV, args.measure.size);
        let moments = moments(animation, MOMENTS);
        let plain = args.rays.div_ceil(moments.len());
        let mut sheets = Vec::new();
        for time in moments {
            let oracle = Oracle::at(&animation.at(time).map_err(Stop::bad)?);
            let answer = |ray: &Ray| oracle.closest(ray).map(|hit| (hit.triangle, hit.t));
            let sorts = rays_at(animation, &view, time, plain);
            for (rays, is_aimed) in sorts.iter().zip([false, true]) {
                sheets.extend(rays.chunks(MOST).map(|rays| Sheet {
                    time,
                    is_aimed,
                    closest: rays.par_iter().map(answer).collect(),
                    blocked: Vec::new(),
                    rays: rays.to_vec(),
                }));
            }
        }
        let light = view.light;
        let mut truth = Self { light, sheets };
        // Shadows are compared with those of `exact` on the host, over fresh trees.
        let method = MethodArgs::of(IntersectorName::Exact, LayoutName::Bvh2);
        let ask = Ask::of(BackendName::Cpu, method, UpdateName::Rebuild);
        let shadows = truth.trace(animation, &ask)?;
        for (sheet, hits) in truth.sheets.iter_mut().zip(shadows) {
            sheet.blocked = hits.blocked;
        }
        Ok(truth)
    }

    /// Traces all rays one way, and counts in its point how often that is wrong.
    pub(super) fn judge(
        &self,
        animation: &Arc<Animation>,
        ask: &Ask<'_>,
        point: &mut plot::Point,
    ) -> Result<(), Stop> {
        let traced = self.trace(animation, ask)?;
        let answers = self.sheets.iter().zip(&traced);
        let errors = answers.flat_map(|(sheet, hits)| count(sheet, hits, point));
        point.t_error_ulp = spread(errors.collect());
        Ok(())
    }

    /// Traces all one way, whose first tree is of the motion's begin.
    fn trace(&self, animation: &Arc<Animation>, ask: &Ask<'_>) -> Result<Vec<Hits>, Stop> {
        let (mut driver, _) = session::start_driver(animation, ask)?;
        let kind = QueryKind::ClosestAndShadow { light: self.light };
        let sheets = self.sheets.iter();
        let sheets = sheets.map(|sheet| (sheet.time, &sheet.rays[..]));
        let lists = iter::once((0.0, &[][..])).chain(sheets);
        Ok(session::trace_lists(&mut driver, kind, lists)?.split_off(1))
    }
}

/// Counts wrong answers. How far off `t` is in units in the last place, wherever the triangle is right.
fn count(sheet: &Sheet, hits: &Hits, point: &mut plot::Point) -> Vec<f64> {
    let mut errors = Vec::new();
    let truth = sheet.closest.iter().zip(&sheet.blocked);
    let answers = hits.closest.iter().zip(&hits.blocked);
    for ((truth, in_shadow), (hit, blocked)) in truth.zip(answers) {
        let right = truth.map_or(!hit.is_hit(), |(triangle, _)| triangle == hit.triangle);
        let (tested, wrong) = match sheet.is_aimed {
            true => (&mut point.aimed.rays, &mut point.aimed.wrong),
            false => (&mut point.rays_tested, &mut point.wrong),
        };
        *tested += 1;
        *wrong += u64::from(!right);
        if right && !sheet.is_aimed {
            point.wrong_shadow += u64::from(blocked != in_shadow);
            errors.extend(truth.map(|(_, t)| off(hit, t)));
        }
    }
    errors
}

fn spread(mut errors: Vec<f64>) -> Option<TError> {
    errors.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| {
        let rank = (errors.len() as f64 * share).ceil() as usize;
        errors.get(rank.saturating_sub(1)).copied()
    };
    (!errors.is_empty()).then(|| TError {
        median: at(0.5),
        p999: at(0.999),
        worst: at(1.0),
    })
}

/// How far a hit's `t` is from the exact one, in units in the last place of that, rounded to f32.
fn off(hit: &Hit, exact: f64) -> f64 {
    let rounded = (exact as f32).abs();
    let unit = f64::from(rounded.next_up()) - f64::from(rounded);
    (f64::from(hit.t) - exact).abs() / unit
}

/// Where rays begin, in sizes of the scene's box.
const ROOM: f64 = 2.0;
/// How often a triangle is drawn before a scene counts as having none to aim at.
const DRAWS: usize = 64;

/// The middle of each of `count` equal stretches of the motion; one moment if nothing moves.
fn moments(animation: &Animation, count: usize) -> Vec<f64> {
    let end = animation.end();
    let count = if end > 0.0 { count } else { 1 };
    let at = |i: usize| end * (i as f64 + 0.5) / count as f64;
    (0..count).map(at).collect()
}

/// `count` rays, half of them a camera's and half at random; and a quarter as many that are aimed.
fn rays_at(animation: &Animation, view: &View, time: f64, count: usize) -> [Vec<Ray>; 2] {
    let mut rng = Rng::with_seed(time.to_bits());
    let bounds = animation.bounds();
    let mut plain = of_camera(view, count / 2);
    plain.resize_with(count, || at_random(&bounds, &mut rng));
    let moment = animation.at(time);
    let aim = |_| aimed(moment.as_ref().ok()?, &bounds, &mut rng);
    [plain, (0..count / 4).filter_map(aim).collect()]
}

/// Of a camera of about that many pixels, row by row; fewer if there is no camera.
fn of_camera(view: &View, count: usize) -> Vec<Ray> {
    let width = (count as f64 * 1.6).sqrt().ceil().max(1.0) as u32;
    let height = count.div_ceil(width as usize).max(1) as u32;
    let camera = view.camera([width, height]);
    camera.map_or_else(Vec::new, |c| c.rays().take(count).collect())
}

/// From somewhere around the box to somewhere in it.
fn at_random(bounds: &Aabb, rng: &mut Rng) -> Ray {
    let from = within(bounds, ROOM, rng);
    towards(from, within(bounds, 1.0, rng))
}

/// From somewhere around the box at a vertex, or at a point on an edge as near as its coordinates can be.
fn aimed(moment: &Moment<'_>, bounds: &Aabb, rng: &mut Rng) -> Option<Ray> {
    let count = u32::try_from(moment.animation().triangle_count()).ok()?;
    let mut draw = || (count > 0).then(|| moment.corners(rng.u32(..count)));
    let corners = (0..DRAWS).find_map(|_| draw().filter(is_active))?;
    let k = rng.usize(..3);
    let (a, b) = (corners[k], corners[(k + 1) % 3]);
    let s = if rng.bool() { 0.0 } else { rng.f32() };
    let at = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]));
    Some(towards(within(bounds, ROOM, rng), at))
}

fn towards(from: Point, to: Point) -> Ray {
    Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
}

/// Anywhere in the box blown up about its middle; the origin if there is no box.
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

    fn hit(triangle: u32, t: f32) -> Hit {
        Hit {
            t,
            triangle,
            ..Hit::MISS
        }
    }

    #[test]
    fn every_sort_of_fault_is_counted_where_it_belongs() {
        let sheet = |is_aimed, closest: &[Option<u32>]| Sheet {
            time: 0.0,
            rays: vec![Ray::new([0.0; 3], [1.0; 3]); closest.len()],
            is_aimed,
            closest: closest.iter().map(|hit| hit.map(|t| (t, 1.0))).collect(),
            blocked: [vec![1], vec![0; closest.len() - 1]].concat(),
        };
        let found = |closest: &[Hit]| Hits {
            closest: closest.to_vec(),
            blocked: vec![0; closest.len()],
        };
        let next = 1.0_f32.next_up();
        let [right, near, other] = [(1, 1.0), (1, next), (2, 1.0)].map(|(i, t)| hit(i, t));
        let plain = [right, near, Hit::MISS, right, other];
        let truth = [Some(1), Some(1), None, None, Some(1)];
        let mut point = plot::Point::default();
        let errors = count(&sheet(false, &truth), &found(&plain), &mut point);
        let aimed = sheet(true, &[Some(1), None]);
        assert!(count(&aimed, &found(&[Hit::MISS; 2]), &mut point).is_empty());
        assert_eq!((point.rays_tested, point.wrong), (5, 2));
        assert_eq!(point.wrong_shadow, 1);
        assert_eq!((point.aimed.rays, point.aimed.wrong), (2, 1));
        let t = spread(errors).unwrap();
        assert_eq!((t.median, t.worst), (Some(0.0), Some(1.0)));
    }

    #[test]
    fn distances_are_compared_before_they_are_rounded() {
        assert_eq!(off(&hit(0, 3.0), 3.0), 0.0);
        let half = 2.0 + f64::from(f32::EPSILON);
        assert_eq!(off(&hit(0, 2.0), half), 0.5);
        assert!(off(&hit(0, 0.0), 0.0) == 0.0);
    }

    #[test]
    fn every_sort_of_ray_is_made_and_the_same_ones_again() {
        let scene = scene::open("demo:collide:300", &scene::Options::default()).unwrap();
        let a = &scene.animation;
        let view = shading::frame_scene(a, 40.0, [64, 40]);
        let rays = rays_at(a, &view, 1.5, 1000).concat();
        assert!(rays.len() == 1250 && rays.iter().all(Ray::is_valid));
        let from_eye = rays.iter().filter(|r| r.origin == view.eye);
        assert_eq!(from_eye.count(), 500);
        assert!(rays == rays_at(a, &view, 1.5, 1000).concat(), "made again");
    }

    #[test]
    fn moments_lie_between_the_ends_and_stillness_has_one() {
        let key = |x| vec![[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let of = |keys| Animation::new(keys, vec![[0, 1, 2]]).unwrap();
        let moving = of(vec![key(0.0), key(1.0), key(2.0)]);
        assert_eq!(moments(&moving, 2), [0.5, 1.5]);
        assert_eq!(moments(&of(vec![key(0.0)]), 2), [0.0]);
    }

    #[test]
    fn a_scene_without_a_triangle_to_aim_at_has_fewer_rays() {
        let nothing = Animation::new(vec![vec![[f32::NAN; 3]]], vec![[0; 3]]).unwrap();
        let view = shading::frame_scene(&nothing, 40.0, [64, 40]);
        let counts = rays_at(&nothing, &view, 0.0, 100).map(|rays| rays.len());
        assert_eq!(counts, [100, 0]);
    }
}
