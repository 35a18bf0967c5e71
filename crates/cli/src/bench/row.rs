//! One run of a bench: what it is made of, and how it is measured.

use super::rays::Bundle;
use crate::args::RaysName;
use crate::choose::{self, Ask};
use crate::memory::{self, DeviceMemory};
use crate::record;
use crate::session::{self, Session};
use crate::stop::Stop;
use crate::table::mrays;
use crate::warm_up::{self, Warmed};
use output::{FrameStats, Summary, TIMES, Taken, Time};
use pipeline::{Frame, FrameRecord, Wanted};
use scene::Scene;
use serde::Serialize;
use std::collections::BTreeMap;

/// One run. Times are medians over its frames, in milliseconds.
#[derive(Serialize)]
pub(crate) struct Row {
    pub(super) scene: String,
    pub(crate) triangles: usize,
    /// Triangles that move.
    pub(super) moving: usize,
    pub(crate) backend: &'static str,
    pub(crate) adapter: String,
    pub(crate) driver: Option<String>,
    pub(super) threads: usize,
    pub(super) builder_threads: usize,
    pub(crate) update: &'static str,
    /// With `async`: whether trees are built for what comes.
    pub(super) predict: Option<bool>,
    pub(crate) intersector: &'static str,
    pub(crate) layout: &'static str,
    /// What kind of rays, if not a camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rays: Option<&'static str>,
    pub(super) frames: usize,
    /// What the device did uncounted after the first frame, where it was warmed up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) warm_up: Option<Warmed>,
    /// Medians by name: of [`TIMES`] and [`MORE`].
    #[serde(flatten)]
    medians: BTreeMap<&'static str, Option<f64>>,
    /// Primary and shadow rays in the time of both.
    pub(crate) mrays_per_s: Option<f64>,
    pub(super) build_ns_per_triangle: Option<f64>,
    convert_ns_per_triangle: Option<f64>,
    pub(super) trees: usize,
    /// Trees that were no better than the one in use.
    rejected: usize,
    /// What was left to `auto`.
    pub(super) auto: Vec<Taken>,
    /// Of the first frame, which waits for the first tree.
    pub(super) first_ms: Option<f64>,
    /// The device's memory, where it can tell.
    pub(super) memory: Option<DeviceMemory>,
    /// Every frame, as in the statistics of `render`.
    pub(crate) per_frame: Vec<FrameStats>,
}

/// What is summed up beside the times of [`TIMES`]. `geometry_ms` is all that comes before rays.
const MORE: [(&str, Time); 4] = [
    ("geometry_ms", geometry),
    ("tree_age_frames", |f| Some(f.tree_age_frames as f64)),
    ("sah_ratio", |f| f.sah_ratio),
    ("sah_cost", |f| f.sah_cost),
];

impl Row {
    /// What is known of a number by its name.
    pub(super) fn median(&self, name: &str) -> Option<f64> {
        self.medians.get(name).copied().flatten()
    }
}

/// What a run is like, beside what is asked of a session.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    /// What kind of rays, one a pixel.
    pub(crate) rays: RaysName,
    /// Pixels of a frame.
    pub(crate) size: [u32; 2],
    /// Seconds for which the device is got ready, if somebody said so.
    pub(crate) warm_up: Option<f64>,
}

/// One run over `frames`.
pub(crate) fn measure(
    run: Run,
    (spec, scene): (&str, &Scene),
    frames: &[Frame],
    ask: &Ask<'_>,
) -> Result<Row, Stop> {
    let bundle = Bundle::of(run.rays, (spec, &scene.animation), run.size)?;
    let query = bundle.query();
    let ask = Ask {
        run: Some(choose::Run { frames, query }),
        ..*ask
    };
    let mut session = session::start(&scene.animation, &ask)?;
    let (mut stats, mut held) = (Vec::new(), None);
    let mut note = |frame: &FrameRecord| {
        stats.push(record::row(frame));
        held = memory::larger(held, frame.device_bytes);
        Ok::<(), Stop>(())
    };
    let driver = &mut session.driver;
    let (warm_up, rest) = warm_up::begin(run.warm_up, driver, frames, query, &mut note)?;
    driver.run(
        rest.iter().copied(),
        query,
        Wanted::default(),
        |frame, _| note(frame),
    )?;
    let row = row(spec, scene, &session, stats, &bundle);
    Ok(Row {
        rays: (run.rays != RaysName::Camera).then_some("random"),
        warm_up,
        memory: held.map(|bytes| DeviceMemory::of(bytes, row.triangles)),
        ..row
    })
}

fn row(
    spec: &str,
    scene: &Scene,
    session: &Session,
    frames: Vec<FrameStats>,
    bundle: &Bundle,
) -> Row {
    let median = |time: Time| Summary::of(frames.iter().filter_map(time)).map(|s| s.median);
    let triangles = scene.animation.live_count();
    let named = TIMES.iter().chain(&MORE);
    let medians: BTreeMap<_, _> = named.map(|&(name, time)| (name, median(time))).collect();
    let [build_ns_per_triangle, convert_ns_per_triangle] = ["build_ms", "convert_ms"]
        .map(|name| medians[name].map(|ms| ms * 1e6 / triangles.max(1) as f64));
    let rates = frames.iter().filter_map(|f| {
        let ms = f.trace_primary_ms? + f.trace_shadow_ms.unwrap_or(0.0);
        mrays(bundle.count(f.hits), ms)
    });
    let device = &session.device;
    Row {
        scene: spec.to_owned(),
        triangles: scene.animation.triangle_count(),
        moving: scene.animation.moving_count(),
        backend: device.backend,
        adapter: device.adapter.clone(),
        driver: (!device.driver.is_empty()).then(|| device.driver.clone()),
        threads: session.threads.render,
        builder_threads: session.threads.build,
        update: session.update.name(),
        predict: session.predict,
        intersector: session.method[0],
        layout: session.method[1],
        rays: None,
        warm_up: None,
        frames: frames.len(),
        medians,
        mrays_per_s: Summary::of(rates).map(|s| s.median),
        build_ns_per_triangle,
        convert_ns_per_triangle,
        trees: frames.iter().filter(|f| f.adopted).count(),
        rejected: frames.iter().filter(|f| f.rejected).count(),
        auto: session.taken.clone(),
        first_ms: frames.first().and_then(|f| f.wall_ms),
        memory: None,
        per_frame: frames,
    }
}

/// Milliseconds of a frame's stages before rays; `None` if it left all of them out.
fn geometry(frame: &FrameStats) -> Option<f64> {
    let stages = [
        frame.interpolate_ms,
        frame.preprocess_ms,
        frame.rebuild_ms,
        frame.refit_ms,
    ];
    stages.into_iter().flatten().reduce(|a, b| a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_is_what_is_known_of_its_stages() {
        let mut frame = FrameStats::default();
        assert_eq!(geometry(&frame), None);
        frame.refit_ms = Some(2.0);
        frame.preprocess_ms = Some(0.5);
        assert_eq!(geometry(&frame), Some(2.5));
    }
}
