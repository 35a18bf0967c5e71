//! One run of a bench: its rays (a camera's with shadows, or random ones), and how it is measured.

use super::FOV;
use crate::args::RaysName;
use crate::choose::Ask;
use crate::open::Opening;
use crate::session::{self, Setup};
use crate::stop::Stop;
use crate::values;
use backend::{DeviceBytes, Query, QueryKind, Rays};
use fastrand::Rng;
use geom::{Aabb, Camera, Point, Ray};
use output::{FrameStats, Summary, TIMES, Time, mrays};
use pipeline::{Driver, Frame, FrameRecord, Wanted, Warmed, warm_up};
use scene::Scene;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// One run. Times are medians over its frames, in milliseconds.
#[derive(Serialize)]
pub(crate) struct Row {
    pub(super) scene: String,
    triangles: usize,
    pub(super) moving: usize,
    #[serde(flatten)]
    pub(crate) setup: Setup,
    /// Kind of rays, if not a camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rays: Option<&'static str>,
    pub(super) frames: usize,
    /// Warm-up of the device after the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) warm_up: Option<Warmed>,
    /// Medians by name: of [`TIMES`] and [`MORE`].
    #[serde(flatten)]
    medians: BTreeMap<&'static str, Option<f64>>,
    /// Millions of rays per second, from primary and shadow rays and the time of both.
    pub(crate) mrays_per_s: Option<f64>,
    pub(super) build_ns_per_triangle: Option<f64>,
    convert_ns_per_triangle: Option<f64>,
    pub(super) trees: usize,
    /// Number of trees that were no better than the current one.
    rejected: usize,
    /// Milliseconds of the first frame, which waits for the first tree.
    first_ms: Option<f64>,
    memory: Option<Value>,
    /// Maximum over all frames.
    device_bytes: Option<u64>,
    /// Of a rival: the share of rays whose triangle or shadow differs from ours, over up to three frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) differing: Option<f64>,
    /// Every frame, as in the statistics of `render`.
    pub(crate) per_frame: Vec<FrameStats>,
}

/// Quantities that are summarized in addition to [`TIMES`]. `geometry_ms` covers all stages before tracing.
const MORE: [(&str, Time); 4] = [
    ("geometry_ms", geometry),
    ("tree_age_frames", |f| Some(f.tree.age_frames as f64)),
    ("sah_ratio", |f| f.tree.sah_ratio),
    ("sah_cost", |f| f.report.sah_cost),
];

impl Row {
    pub(super) fn median(&self, name: &str) -> Option<f64> {
        self.medians.get(name).copied().flatten()
    }

    /// Returns all frames but the first, which waits for the first tree. Returns the first if it is the only one.
    pub(crate) fn later_frames(&self) -> &[FrameStats] {
        let later = self.per_frame.get(1..).filter(|rest| !rest.is_empty());
        later.unwrap_or(&self.per_frame)
    }
}

/// Returns the device time of a frame plus its wait for its tree, in milliseconds.
pub(crate) fn frame_ms(frame: &FrameStats) -> f64 {
    frame.report.times.device_ms + frame.build_wait_ms.unwrap_or(0.0)
}

/// What is measured, by a backend or by a rival.
#[derive(Clone, Copy)]
pub(crate) struct Combination<'a> {
    pub(crate) spec: &'a str,
    pub(crate) scene: &'a Scene,
    pub(crate) frames: &'a [Frame],
    pub(crate) rays: RaysName,
    pub(crate) size: [u32; 2],
    /// Seconds of warm-up, or `None` for the default of the kind of device.
    pub(crate) warm_up: Option<f64>,
}

/// The rays of all frames of a combination.
pub(super) struct Shots {
    camera: Camera,
    light: Point,
    /// Random rays, if they are traced instead of the camera's.
    list: Option<Vec<Ray>>,
}

impl Shots {
    pub(super) fn of(combination: &Combination<'_>) -> Result<Self, Stop> {
        let Combination {
            spec, scene, size, ..
        } = *combination;
        let view = shading::frame_scene(&scene.animation, FOV, size);
        let camera = view.camera(size);
        let camera = camera.ok_or_else(|| Stop::bad(format!("no camera frames {spec}")))?;
        let random = || random_rays(&scene.animation.bounds(), camera.pixels());
        let list = (combination.rays == RaysName::Random).then(random);
        Ok(Self {
            camera,
            light: view.light,
            list,
        })
    }

    pub(super) fn query(&self) -> Query<'_> {
        match &self.list {
            None => shading::query((&self.camera, self.light)),
            Some(list) => Query {
                rays: Rays::List(list),
                kind: QueryKind::Closest,
            },
        }
    }
}

/// Frames of one run as they were measured.
pub(super) struct Measured {
    pub(super) setup: Setup,
    pub(super) warm_up: Option<Warmed>,
    pub(super) stats: Vec<FrameStats>,
    /// The most device memory that was held.
    pub(super) held: Option<DeviceBytes>,
    /// See [`Row::differing`].
    pub(super) differing: Option<f64>,
}

/// Measures on the backend that is being opened. Also returns the driver, with the scene loaded.
pub(crate) fn measure(
    combination: &Combination<'_>,
    ask: &Ask<'_>,
    opening: Opening,
) -> Result<(Row, Driver), Stop> {
    let Combination { scene, frames, .. } = *combination;
    let shots = Shots::of(combination)?;
    let query = shots.query();
    let ask = ask.over(frames, query);
    let (mut driver, setup) = session::start_driver_on(opening, &scene.animation, &ask)?;
    let (mut stats, mut held) = (Vec::new(), None::<DeviceBytes>);
    let mut note = |frame: &FrameRecord| {
        stats.push(FrameStats::of(frame));
        let both = held.into_iter().chain(frame.device_bytes);
        held = both.max_by_key(|bytes| bytes.total());
        Ok::<(), Stop>(())
    };
    let (warm_up, rest) = warm_up(combination.warm_up, &mut driver, frames, query, &mut note)?;
    let rest = rest.iter().copied();
    driver.run(rest, query, Wanted::default(), |frame, _| note(frame))?;
    let measured = Measured {
        setup,
        warm_up,
        stats,
        held,
        differing: None,
    };
    Ok((Row::of(combination, measured), driver))
}

impl Row {
    pub(super) fn of(combination: &Combination<'_>, measured: Measured) -> Self {
        let Measured {
            setup,
            warm_up,
            stats,
            held,
            differing,
        } = measured;
        let Combination { scene, size, .. } = *combination;
        let median = |time: Time| Summary::of(stats.iter().filter_map(time)).map(|s| s.median);
        let named = TIMES.iter().chain(&MORE);
        let medians: BTreeMap<_, _> = named.map(|&(name, time)| (name, median(time))).collect();
        let triangles = scene.animation.triangle_count();
        let live = scene.animation.live_count().max(1) as f64;
        let per_triangle = |name: &str| medians[name].map(|ms| ms * 1e6 / live);
        let is_camera = combination.rays == RaysName::Camera;
        let rates = stats.iter().filter_map(|f| {
            let times = &f.report.times;
            let ms = times.trace_primary_ms? + times.trace_shadow_ms.unwrap_or(0.0);
            let shadows = if is_camera { f.report.hits as f64 } else { 0.0 };
            mrays(values::pixels(size) as f64 + shadows, ms)
        });
        Self {
            scene: combination.spec.to_owned(),
            triangles,
            moving: scene.animation.moving_count(),
            setup,
            rays: (!is_camera).then_some("random"),
            warm_up,
            frames: stats.len(),
            mrays_per_s: Summary::of(rates).map(|s| s.median),
            build_ns_per_triangle: per_triangle("build_ms"),
            convert_ns_per_triangle: per_triangle("convert_ms"),
            trees: stats.iter().filter(|f| f.tree.adopted).count(),
            rejected: stats.iter().filter(|f| f.tree.rejected).count(),
            first_ms: stats.first().and_then(|f| f.wall_ms),
            memory: held.map(|bytes| device_memory(bytes, triangles)),
            device_bytes: held.map(|bytes| bytes.total()),
            differing,
            medians,
            per_frame: stats,
        }
    }
}

/// Returns device memory by use, in total and per triangle.
fn device_memory(held: DeviceBytes, triangles: usize) -> Value {
    let parts = [held.tree, held.scratch, held.scene, held.frames];
    let named = |[tree, scratch, scene, frames]: [Value; 4]| json!({ "tree": tree, "scratch": scratch, "scene": scene, "frames": frames });
    let each = |bytes: u64| json!(bytes as f64 / triangles.max(1) as f64);
    json!({
        "bytes": named(parts.map(|bytes| json!(bytes))),
        "bytes_per_triangle": named(parts.map(each)),
    })
}

/// Returns the milliseconds of a frame's stages before tracing, or `None` if it skipped every stage.
fn geometry(frame: &FrameStats) -> Option<f64> {
    let times = &frame.report.times;
    let stages = [
        times.interpolate_ms,
        times.preprocess_ms,
        times.rebuild_ms,
        times.refit_ms,
    ];
    stages.into_iter().flatten().reduce(|a, b| a + b)
}

/// Returns rays from random points in a box in random directions, the same on every machine.
pub(crate) fn random_rays(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut rng = Rng::with_seed(0);
    let mut ray = || {
        let mut at = |i: usize| bounds.min[i] + rng.f32() * (bounds.max[i] - bounds.min[i]);
        let origin = [at(0), at(1), at(2)];
        Ray::new(origin, direction(&mut rng))
    };
    (0..count).map(|_| ray()).collect()
}

/// Returns a uniformly distributed direction: a point of the unit ball, found by rejection.
fn direction(rng: &mut Rng) -> Point {
    loop {
        let mut side = || 2.0 * rng.f32() - 1.0;
        let v = [side(), side(), side()];
        let square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        if (0.01..=1.0).contains(&square) {
            return v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_is_what_is_known_of_its_stages() {
        let mut frame = FrameStats::default();
        assert_eq!(geometry(&frame), None);
        frame.report.times.refit_ms = Some(2.0);
        frame.report.times.preprocess_ms = Some(0.5);
        assert_eq!(geometry(&frame), Some(2.5));
    }

    #[test]
    fn random_rays_fill_the_box_and_all_directions_evenly() {
        let bounds = Aabb {
            min: [-1.0, 10.0, 0.0],
            max: [3.0, 11.0, 0.0],
        };
        let rays = random_rays(&bounds, 20_000);
        let within = |r: &Ray| bounds.with_point(r.origin) == bounds;
        assert!(rays.iter().all(|r| r.is_valid() && within(r)));
        let mean = |of: &dyn Fn(&Ray) -> f32| {
            rays.iter().map(|r| f64::from(of(r))).sum::<f64>() / rays.len() as f64
        };
        assert!((mean(&|r| r.origin[0]) - 1.0).abs() < 0.05);
        assert!((mean(&|r| r.origin[1]) - 10.5).abs() < 0.02);
        for i in 0..3 {
            assert!(mean(&|r| r.direction[i]).abs() < 0.02);
            // Each axis has a third of the squared length.
            let share = |r: &Ray| {
                let squares = r.direction.map(|x| x * x);
                squares[i] / squares.iter().sum::<f32>()
            };
            assert!((mean(&share) - 1.0 / 3.0).abs() < 0.01);
        }
        assert_eq!(random_rays(&bounds, 3), rays[..3]);
    }
}
