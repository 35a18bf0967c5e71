//! `exact` against the oracle, which shares no code with it: every ray, without exception.

use backend::{Backend, Intersector, QueryKind, Rays};
use conformance::oracle::Oracle;
use conformance::{Target, aimed, nth_case};
use geom::{Animation, Hit, Point, Ray, Triangle};
use integration::is_full;
use integration::scenes::Source;
use integration::stage::{self, Stage, camera, light, method};
use libtest_mimic::{Failed, Trial};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Odd scenes on the host, a seventh of them a trial; and on each device.
const ODD: u32 = 7;

pub(crate) fn trials() -> Vec<Trial> {
    let odd = |k| Trial::test(format!("odd_scenes_of_kind_{k}"), move || odd_scenes(k));
    let on_devices = Device::ALL.map(|device| device.trial("odd_scenes", odd_scenes_on));
    (0..ODD).map(odd).chain(on_devices).collect()
}

pub(crate) fn of_scene(source: Source) -> [Trial; 3] {
    [
        source.trial("every_pixels_shadow", shadows),
        source.trial("every_pixel", pixels),
        source.trial("every_ray_at_an_edge_or_a_vertex", rays_at_edges),
    ]
}

fn pixels(source: Source) -> Result<(), Failed> {
    let animation = source.animation()?;
    let rays = stage::pixels(&animation);
    let times = [0.0, 0.618 * animation.end()];
    times
        .iter()
        .try_for_each(|&time| check(&animation, time, &rays))
}

/// The shadow's ray is repeated here, operation for operation, and asked of the oracle.
fn shadows(source: Source) -> Result<(), Failed> {
    let animation = source.animation()?;
    if animation.scale_exponent() != 0 {
        return Err("the oracle knows no scaled units".into());
    }
    let rays = camera(&animation, [120, 80]).rays().collect::<Vec<_>>();
    let light = light(&animation);
    let time = 0.618 * animation.end();
    let oracle = Oracle::at(&animation, animation.pose(time));
    let mut stage = Stage::new(&animation, Intersector::Exact, 2);
    stage.plant(time);
    let kind = QueryKind::ClosestAndShadow { light };
    let hits = stage.trace(time, Rays::List(&rays), kind);
    let corners = |t: u32| animation.corners(animation.pose(time), t);
    let longest = longest_edge(&animation, time);
    for (i, (hit, &blocked)) in hits.closest.iter().zip(&hits.blocked).enumerate() {
        let ray = hit
            .is_hit()
            .then(|| shadow_ray(hit, &corners(hit.triangle), rays[i].origin, light, longest));
        let expected =
            ray.is_some_and(|ray| oracle.all(&ray).iter().any(|h| h.triangle != hit.triangle));
        if (blocked == 1) != expected {
            return Err(format!(
                "ray {i}, {hit:?}: blocked {blocked}, expected {expected} by {ray:?}"
            )
            .into());
        }
    }
    Ok(())
}

/// The longest edge of the box of all triangles that can be hit.
fn longest_edge(animation: &Animation, time: f64) -> f32 {
    let all =
        (0..animation.triangle_count() as u32).map(|t| animation.corners(animation.pose(time), t));
    let hittable = all.filter(|c| geom::is_active(c) && !geom::is_degenerate(c));
    let bounds = hittable
        .flatten()
        .fold(geom::Aabb::EMPTY, |b, p| b.with_point(p));
    bounds.extent().into_iter().fold(0.0, f32::max)
}

/// "Shadow rays" in `docs/design/hits.md`, for a scene that is not scaled and holds no number too small to count.
fn shadow_ray(hit: &Hit, [v0, v1, v2]: &Triangle, eye: Point, light: Point, longest: f32) -> Ray {
    let minus = |a: Point, b: Point| -> Point { std::array::from_fn(|i| a[i] - b[i]) };
    let (e1, e2) = (minus(*v1, *v0), minus(*v2, *v0));
    let p: Point = std::array::from_fn(|i| v0[i] + (hit.u * e1[i] + hit.v * e2[i]));
    let component = |i: usize, j: usize| e1[i] * e2[j] - e1[j] * e2[i];
    let normal = [component(1, 2), component(2, 0), component(0, 1)];
    let above = |q: Point| {
        let d = minus(q, p);
        sign(normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2])
    };
    let side = if above(light) == 0.0 {
        above(eye)
    } else {
        above(light)
    };
    let largest = p.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let unit = f32::EPSILON / 2.0;
    let delta = 4.0 * unit * largest + 32.0 * unit * longest;
    let origin: Point = std::array::from_fn(|i| p[i] + side * sign(normal[i]) * delta);
    Ray {
        t_max: 1.0,
        ..Ray::new(origin, minus(light, origin))
    }
}

fn sign(x: f32) -> f32 {
    f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}

fn rays_at_edges(source: Source) -> Result<(), Failed> {
    let animation = source.animation()?;
    let time = 0.618 * animation.end();
    for target in Target::ALL {
        for distance in [0.6, 100.0, 1e4] {
            let rays = aimed(&animation, time, target, distance, 400);
            check(&animation, time, &rays)?;
        }
    }
    Ok(())
}

/// Slivers, stacks, far and tiny scenes, with rays along axes, through edges, with limits.
fn odd_scenes(kind: u32) -> Result<(), Failed> {
    for number in (0..40).map(|i| kind + ODD * i) {
        let case = nth_case(7, number);
        for &time in &case.times[..2] {
            check(&case.animation, time, &case.rays)
                .map_err(|e| format!("case {number}: {}", e.message().unwrap_or_default()))?;
        }
    }
    Ok(())
}

/// Likewise on a device.
fn odd_scenes_on(device: Device) -> Result<(), Failed> {
    let mut backend = device.open()?;
    for i in 0..if is_full() { 28 } else { 14 } {
        let case = nth_case(11, i);
        let mut stage = Stage::over(backend, &case.animation, method(Intersector::Exact));
        check_on(&mut stage, &case.animation, case.times[1], &case.rays)
            .map_err(|e| format!("case {i}: {}", e.message().unwrap_or_default()))?;
        backend = stage.into_backend();
    }
    Ok(())
}

/// One device at a time: software drivers of old fall over when two loaders compile kernels at once.
static DOOR: Mutex<()> = Mutex::new(());

/// Whose kernels settle rays.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Device {
    Vulkan,
    Wgpu,
}

impl Device {
    pub(crate) const ALL: [Self; 2] = [Self::Vulkan, Self::Wgpu];

    pub(crate) fn open(self) -> backend::Result<Box<dyn Backend>> {
        Ok(match self {
            Self::Vulkan => Box::new(gpu_vulkan::VulkanBackend::new(&Default::default())?),
            Self::Wgpu => Box::new(gpu_wgpu::WgpuBackend::new(&Default::default())?),
        })
    }

    /// Ignored where there is no device.
    pub(crate) fn trial(self, what: &str, test: fn(Self) -> Result<(), Failed>) -> Trial {
        let name = format!("{what}_on_{self:?}").to_lowercase();
        let there = self.open().is_ok();
        let alone = move || {
            let _door = DOOR.lock().unwrap_or_else(PoisonError::into_inner);
            test(self)
        };
        Trial::test(name, alone).with_ignored_flag(!there)
    }
}

/// Closest hits and any hits of all rays, each against the oracle.
fn check(animation: &Arc<Animation>, time: f64, rays: &[Ray]) -> Result<(), Failed> {
    let mut stage = Stage::new(animation, Intersector::Exact, 2);
    check_on(&mut stage, animation, time, rays)
}

pub(crate) fn check_on(
    stage: &mut Stage,
    animation: &Animation,
    time: f64,
    rays: &[Ray],
) -> Result<(), Failed> {
    let oracle = Oracle::at(animation, animation.pose(time));
    stage.plant(time);
    let closest = stage.closest(time, rays);
    let any = stage.trace(time, Rays::List(rays), QueryKind::Any);
    let wrong = (0..rays.len()).into_par_iter().find_first(|&i| {
        let expected = oracle.closest(&rays[i]);
        let found = closest.closest[i];
        found.is_hit() != expected.is_some()
            || expected.is_some_and(|e| e.triangle != found.triangle)
            || (any.blocked[i] == 1) != expected.is_some()
    });
    match wrong {
        None => Ok(()),
        Some(i) => Err(format!(
            "at {time}: ray {i}, {:?}, finds {:?} (any: {}), expected {:?}",
            rays[i],
            closest.closest[i],
            any.blocked[i],
            oracle.closest(&rays[i])
        )
        .into()),
    }
}
