//! How long each intersector over each layout takes, by the device's clock.

use super::Run;
use super::stand::{TrialBackend, frame};
use crate::stop::Stop;
use crate::warm_up;
use backend::{DeviceKind, Method, Query, Rays};
use geom::{Camera, Ray};
use pipeline::{Driver, Frame, FrameRecord, Update};
use std::time::Instant;

/// Frames that are timed each time a method has its turn, after one that makes the tree.
pub(super) const FRAMES: usize = 6;
/// The most pixels of a frame that host cores trace for this; the rest is multiplied.
const PIXELS_ON_HOST: usize = 1 << 16;

/// A method and the milliseconds of a frame; those of the host's build beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timed {
    pub(super) method: Method,
    pub(super) ms: f64,
    pub(super) build_ms: f64,
}

/// Times `candidates` in the middle of the run, in order and back again; the fastest first. What the
/// backend refuses is left out.
///
/// # Errors
/// Nothing could be timed.
pub(super) fn time(
    stand: &mut TrialBackend<'_>,
    candidates: &[Method],
    run: &Run<'_>,
) -> Result<Vec<Timed>, Stop> {
    let mut all: Vec<Timed> = Vec::new();
    let mut refused = None;
    for &method in candidates.iter().chain(candidates.iter().rev()) {
        if candidates.len() == 1 && !all.is_empty() {
            break;
        }
        match turn(stand, method, run) {
            Ok(new) => match all.iter_mut().find(|t| t.method == method) {
                Some(old) => old.ms = old.ms.min(new.ms),
                None => all.push(new),
            },
            Err(stop) => refused = Some(stop),
        }
    }
    all.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    match refused {
        Some(stop) if all.is_empty() => Err(stop),
        _ => Ok(all),
    }
}

/// One turn of one method: the least time of a few frames.
fn turn(stand: &mut TrialBackend<'_>, method: Method, run: &Run<'_>) -> Result<Timed, Stop> {
    let on_host = stand.device.kind != DeviceKind::Gpu;
    let fewer = on_host.then(|| Fewer::of(run.query.rays, PIXELS_ON_HOST));
    let (rays, share) = fewer.as_ref().map_or((run.query.rays, 1.0), Fewer::rays);
    let query = Query { rays, ..run.query };
    let idle = Instant::now();
    let mut driver = stand.driver(method, Update::Refit)?;
    let timed = least(&mut driver, run, (query, share), idle);
    stand.put_back(driver);
    let (ms, build_ms) = timed?;
    Ok(Timed {
        method,
        ms,
        build_ms,
    })
}

fn least(
    driver: &mut Driver,
    run: &Run<'_>,
    (query, share): (Query<'_>, f64),
    idle: Instant,
) -> Result<(f64, f64), Stop> {
    let middle = run.frames.len() / 2;
    let mut ms = f64::INFINITY;
    let mut build_ms = 0.0;
    // Frames next to each other, so that no stage is left out.
    for i in 0..=FRAMES {
        let Some(&at) = run.frames.get((middle + i) % run.frames.len()) else {
            break;
        };
        let index = i as u64;
        let record = frame(driver, Frame { index, ..at }, query, None)?;
        if let Some(adopted) = record.adopted {
            build_ms = adopted.build_ms + adopted.convert_ms;
            warm_up::after_idling(driver, query, idle.elapsed())?;
        } else {
            ms = ms.min(whole(&record, share));
        }
    }
    Ok((ms, build_ms))
}

/// The device's milliseconds had all pixels been traced.
fn whole(record: &FrameRecord, share: f64) -> f64 {
    let times = &record.report.times;
    let rays = times.trace_primary_ms.unwrap_or(0.0) + times.trace_shadow_ms.unwrap_or(0.0);
    times.device_ms + rays * (share - 1.0)
}

/// Rays that stand for more, and how many times fewer they are.
enum Fewer {
    Camera(Box<Camera>, f64),
    List(Vec<Ray>, f64),
}

impl Fewer {
    fn of(rays: Rays<'_>, most: usize) -> Self {
        match rays {
            Rays::Camera(camera) => {
                let (thin, share) = thinned(camera, most);
                Self::Camera(Box::new(thin), share)
            }
            Rays::List(list) => {
                let step = list.len().div_ceil(most).max(1);
                let some: Vec<Ray> = list.iter().copied().step_by(step).collect();
                let share = list.len() as f64 / some.len().max(1) as f64;
                Self::List(some, share)
            }
        }
    }

    fn rays(&self) -> (Rays<'_>, f64) {
        match self {
            Self::Camera(camera, share) => (Rays::Camera(camera), *share),
            Self::List(list, share) => (Rays::List(list), *share),
        }
    }
}

/// A camera with the same view and fewer pixels, at most `most`; and how many times fewer they are.
fn thinned(camera: &Camera, most: usize) -> (Camera, f64) {
    let by = (camera.pixels() as f64 / most as f64)
        .sqrt()
        .ceil()
        .max(1.0);
    let fewer = |side: u32| (f64::from(side) / by).ceil().max(1.0) as u32;
    let step = |by: f64, v: [f32; 3]| v.map(|x| (f64::from(x) * by) as f32);
    let (width, height) = (fewer(camera.width), fewer(camera.height));
    let thin = Camera {
        width,
        height,
        across: step(f64::from(camera.width) / f64::from(width), camera.across),
        down: step(f64::from(camera.height) / f64::from(height), camera.down),
        ..*camera
    };
    (thin, camera.pixels() as f64 / thin.pixels() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_of_fewer_pixels_sees_the_same() {
        let look =
            |size| Camera::look_at([0.0, 1.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, size).unwrap();
        let whole = look([1280, 720]);
        let (thin, share) = thinned(&whole, 10_000);
        assert!(thin.pixels() <= 11_000, "{}", thin.pixels());
        assert_eq!(share, 921_600.0 / thin.pixels() as f64);
        let far = |c: &Camera| {
            let [w, h] = [c.width as f32, c.height as f32];
            [0, 1, 2].map(|i| c.corner[i] + w * c.across[i] + h * c.down[i])
        };
        let [a, b] = [far(&whole), far(&thin)];
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-4), "{a:?} {b:?}");
        let (list, times) = (vec![Ray::new([0.0; 3], [1.0; 3]); 1000], 1000.0 / 91.0);
        let fewer = Fewer::of(Rays::List(&list), 99);
        let (rays, share) = fewer.rays();
        assert_eq!((rays.count(), share), (91, times));
        let small = look([10, 10]);
        assert_eq!(thinned(&small, 10_000), (small, 1.0));
    }
}
