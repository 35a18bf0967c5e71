//! Rays that take devices more work than most: far away, at ties, at hits that a first search leaves open.

use crate::exact::{Device, check_on};
use crate::ridges;
use backend::{Hits, Intersector, QueryKind, Rays};
use conformance::{Target, aimed};
use geom::{Animation, Camera, Ray};
use integration::stage::{Stage, camera, light, method};
use libtest_mimic::{Failed, Trial};
use std::f32::consts::TAU;
use std::sync::Arc;

pub(crate) fn trials(device: Device) -> [Trial; 7] {
    [
        device.trial("rays_from_far_away", far_rays),
        device.trial("rays_through_a_hub", hubs),
        device.trial("rays_through_a_stack", stacks),
        device.trial("pictures_from_far_away", pictures),
        device.trial("watertight_is_not_wrong_without_a_word", watertight),
        device.trial("shadows_of_hits_that_were_left_open", doubled),
        device.trial("shadows_of_the_candidates_of_few_open_hits", ridges::test),
    ]
}

/// `exact` on the device.
fn exact(device: Device, animation: &Arc<Animation>) -> backend::Result<Stage> {
    let by = method(Intersector::Exact);
    Ok(Stage::over(device.open()?, animation, by))
}

/// The host's hits must be the device's, bit for bit.
pub(crate) fn same(expected: &Hits, found: &Hits) -> Result<(), Failed> {
    let hits = expected.closest.iter().zip(&expected.blocked);
    let others = found.closest.iter().zip(&found.blocked);
    match hits.zip(others).enumerate().find(|(_, (a, b))| a != b) {
        _ if expected.closest.len() != found.closest.len() => Err("other numbers of hits".into()),
        Some((i, (a, b))) => Err(format!("pixel {i}: {b:?}, not {a:?}").into()),
        None => Ok(()),
    }
}

fn cloth() -> Result<Arc<Animation>, Failed> {
    let opened = scene::open("demo:twist:1500", &scene::Options::default());
    Ok(opened.map_err(|e| e.to_string())?.animation)
}

/// From where every triangle is a candidate, and from where rounded arithmetic says nothing at all.
fn far_rays(device: Device) -> Result<(), Failed> {
    let animation = cloth()?;
    let mut stage = exact(device, &animation)?;
    for distance in [1e6, 1e22, 1e25] {
        let rays = aimed(&animation, 0.0, Target::Vertex, distance, 60);
        check_on(&mut stage, &animation, 0.0, &rays)?;
    }
    Ok(())
}

/// So many triangles round one corner, and another corner of each on a circle.
fn hub(triangles: u32) -> Arc<Animation> {
    let spoke = |i: u32| {
        let (y, x) = (i as f32 * TAU / triangles as f32).sin_cos();
        [x, y, 0.25 * (i % 3) as f32]
    };
    let points = [[0.0, 0.0, 0.5]]
        .into_iter()
        .chain((0..triangles).map(spoke));
    let ring = (0..triangles).map(|i| [0, 1 + i, 1 + (i + 1) % triangles]);
    Arc::new(Animation::new(vec![points.collect()], ring.collect()).expect("a scene"))
}

/// Rays through the hub, that begin before themselves, too: those are left to numbers of any length.
fn hubs(device: Device) -> Result<(), Failed> {
    let animation = hub(500);
    let mut stage = exact(device, &animation)?;
    let from = |x: f32, y: f32, t_min: f32| Ray {
        t_min,
        ..Ray::new([x, y, 3.0], [-x, -y, -2.5])
    };
    let places = (0..12).map(|i| [0.5 * (i % 4) as f32 - 0.75, 0.5 * (i / 4) as f32 - 0.5]);
    let rays: Vec<_> = places
        .flat_map(|[x, y]| [0.0, 0.5, 1.0, -1.0, f32::NEG_INFINITY].map(|t| from(x, y, t)))
        .collect();
    check_on(&mut stage, &animation, 0.0, &rays)
}

/// So many triangles in one place.
fn stack(triangles: usize) -> Arc<Animation> {
    let points = vec![[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 3.0, 1.0]];
    let all = vec![[0, 1, 2]; triangles];
    Arc::new(Animation::new(vec![points], all).expect("a scene"))
}

/// The search itself takes more turns than there are.
const TALL: usize = 30_000;
/// The search does not, but going through its notes does.
const LOWER: usize = 12_000;

fn down(x: f32) -> Ray {
    Ray::new([x, 0.5, 4.0], [0.25, 0.125, -3.0])
}

fn stacks(device: Device) -> Result<(), Failed> {
    for triangles in [TALL, LOWER] {
        let animation = stack(triangles);
        let mut stage = exact(device, &animation)?;
        check_on(&mut stage, &animation, 0.0, &[down(0.5), down(9.0)])?;
    }
    Ok(())
}

/// Right, or refused.
fn watertight(device: Device) -> Result<(), Failed> {
    let animation = stack(TALL);
    let by = method(Intersector::Watertight);
    let mut stage = Stage::over(device.open()?, &animation, by);
    stage.plant(0.0);
    let rays = [down(0.5), down(9.0)];
    match stage.try_trace(0.0, Rays::List(&rays), QueryKind::Closest) {
        Ok(hits) if hits.closest[0].triangle == 0 && !hits.closest[1].is_hit() => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// A camera's rays and their shadows, which kernels make by themselves, are those of the host, bit for bit.
fn pictures(device: Device) -> Result<(), Failed> {
    let animation = cloth()?;
    let mut host = Stage::new(&animation, Intersector::Exact, 2);
    let mut stage = exact(device, &animation)?;
    host.plant(0.0);
    stage.plant(0.0);
    for (distance, light) in [(3.0, 1e6), (1e6, 3.0), (1e25, 1e7)] {
        let camera = camera_at(distance, &animation);
        let kind = QueryKind::ClosestAndShadow {
            light: [0.3 * light, light, 0.2 * light],
        };
        let rays = Rays::Camera(&camera);
        let [expected, found] = [&mut host, &mut stage].map(|s| s.trace(0.0, rays, kind));
        if expected.closest.iter().all(|h| !h.is_hit()) {
            return Err(format!("from {distance}: no hits").into());
        }
        same(&expected, &found)?;
    }
    Ok(())
}

/// As far away as that along an axis, with the scene in the middle of the picture.
fn camera_at(distance: f32, animation: &Animation) -> Camera {
    let size = animation.bounds().extent().into_iter().fold(0.0, f32::max);
    let angle = (size / distance).min(1.0).to_degrees();
    let (eye, up) = ([0.0, distance, 0.0], [0.0, 0.0, 1.0]);
    Camera::look_at(eye, [0.0; 3], up, angle, [16, 12]).expect("a picture")
}

/// Every triangle twice, and some once more, turned round: every hit is a tie, so that a device's first search leaves
/// them all open, and their shadows too.
fn twice(animation: &Animation) -> Result<Arc<Animation>, Failed> {
    let triangles = animation.triangles();
    let turned = triangles.iter().step_by(3).map(|&[a, b, c]| [b, c, a]);
    let all = triangles.iter().chain(triangles).copied().chain(turned);
    let frames = animation.keys().to_vec();
    let doubled = Animation::new(frames, all.collect()).map_err(|e| e.to_string())?;
    Ok(Arc::new(doubled))
}

fn doubled(device: Device) -> Result<(), Failed> {
    let opened = scene::open("demo:collide:2000", &scene::Options::default());
    let animation = twice(&opened.map_err(|e| e.to_string())?.animation)?;
    let time = 0.4 * animation.end();
    let camera = camera(&animation, [150, 90]);
    let kind = QueryKind::ClosestAndShadow {
        light: light(&animation),
    };
    let rays = Rays::Camera(&camera);
    let ask = |mut stage: Stage| {
        stage.plant(0.0);
        stage.try_trace(time, rays, kind)
    };
    let expected = ask(Stage::new(&animation, Intersector::Exact, 2))?;
    let hits = expected.closest.iter().filter(|h| h.is_hit()).count();
    let blocked = expected.blocked.iter().filter(|&&b| b == 1).count();
    if hits < 1000 || blocked < 100 || blocked + 100 > hits {
        return Err(format!("{hits} hits, {blocked} in shadow: too few to tell").into());
    }
    same(&expected, &ask(exact(device, &animation)?)?)
}
