//! What a frame takes under one update policy, over frames that go to and fro through a motion, for as long as there
//! is patience.

use crate::ahead::Ahead;
use crate::args::{
    BackendName, IntersectorName, LayoutName, MethodArgs, Switch, TimingArgs, UpdateName,
};
use crate::bench::FOV;
use crate::choose;
use crate::memory;
use crate::session::{self, Ask};
use crate::stop::Stop;
use crate::warm_up::{WarmUp, Warmed};
use backend::{Device, DeviceBytes, Query, QueryKind, Rays};
use clap::ValueEnum;
use geom::Animation;
use pipeline::{Driver, Frame, FrameRecord, PipelineError, Update};
use report::Summary;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Medians that a run is summed up by.
const PARTS: usize = 8;
/// A tree for a whole time range takes so many times as long to build as a first one: 9 to 15 were seen, 10 of 1.6M
/// triangles.
pub(crate) const FOR_ALL: f64 = 11.0;
/// What is slower by less than this share is as fast.
pub(crate) const NOISE: f64 = 0.03;

/// A policy with what it goes with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) update: UpdateName,
    pub(crate) layout: LayoutName,
    /// `None` for the usual share of the host's threads.
    pub(crate) builder_threads: Option<usize>,
}

/// What all runs of a comparison share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a> {
    pub(crate) backend: BackendName,
    pub(crate) adapter: Option<&'a str>,
    pub(crate) size: [u32; 2],
    /// How the device is got ready.
    pub(crate) warm_up: WarmUp,
    /// No frame is begun after so long, once there are two.
    pub(crate) patience: Duration,
}

impl TimingArgs {
    /// What all runs share.
    pub(crate) fn setting(&self) -> Setting<'_> {
        Setting {
            backend: self.backend,
            adapter: self.adapter.as_deref(),
            size: self.size.size,
            warm_up: self.warm_up.warm_up(),
            patience: Duration::from_secs_f64(self.patience),
        }
    }
}

/// Milliseconds of a frame, and what else was seen.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Timing {
    #[serde(skip)]
    pub(crate) device: Device,
    pub(crate) builder_threads: usize,
    /// Of the host's clock: the mean of the medians of eight parts of the run, without its first frame.
    pub(crate) frame_ms: f64,
    /// Of interpolation, preprocessing and what brings the tree up to date, by the device's clock: the median.
    pub(crate) geometry_ms: Option<f64>,
    /// Of primary and shadow rays, likewise.
    pub(crate) trace_ms: Option<f64>,
    /// Of the first frame, which waits for the first tree.
    pub(crate) first_ms: f64,
    /// Of the first tree, on the host.
    pub(crate) build_ms: Option<f64>,
    #[serde(serialize_with = "memory::in_all")]
    pub(crate) device_bytes: Option<DeviceBytes>,
    /// What the device did uncounted after the first frame, where it was warmed up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) warm_up: Option<Warmed>,
    pub(crate) frames: usize,
    /// Whether patience ran out before the frames did: where a tree ages, `frame_ms` is then too small.
    pub(crate) cut_short: bool,
}

/// So many frames from the motion's first moment to its last and back again, `speed` key frames apart.
pub(crate) fn ping_pong(end: f64, speed: f64, count: usize) -> Vec<Frame> {
    let time = |i: u64| {
        let gone = (i as f64 * speed) % (2.0 * end).max(f64::MIN_POSITIVE);
        if gone <= end { gone } else { 2.0 * end - gone }
    };
    let frame = |index| Frame {
        index,
        time: time(index).clamp(0.0, end),
    };
    (0..count as u64).map(frame).collect()
}

/// Times one way.
///
/// # Errors
/// The backend cannot do it.
pub(crate) fn time(
    setting: &Setting<'_>,
    animation: &Arc<Animation>,
    frames: &[Frame],
    way: Way,
) -> Result<Timing, Stop> {
    let view = picture::frame_scene(animation, FOV, setting.size);
    let camera = view.camera(setting.size);
    let camera = camera.ok_or_else(|| Stop::bad("no camera frames the scene"))?;
    let query = Query {
        rays: Rays::Camera(&camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
    };
    let ask = Ask {
        backend: setting.backend,
        adapter: setting.adapter,
        threads: None,
        builder_threads: way.builder_threads,
        method: MethodArgs {
            intersector: IntersectorName::Watertight,
            layout: way.layout,
        },
        update: choose::asked(policy(way.update)?),
        tolerance: 0.0,
        run: None,
        ahead: Ahead::of(frames, Switch::On),
    };
    let mut session = session::start(animation, &ask)?;
    let mut seen = Seen::default();
    seen.run(&mut session.driver, frames, query, setting)?;
    let builder_threads = session.threads.build;
    Ok(seen.sum_up(session.device, builder_threads))
}

/// The policy of a name.
///
/// # Errors
/// `auto` is none.
fn policy(name: UpdateName) -> Result<Update, Stop> {
    Ok(match name {
        UpdateName::Rebuild => Update::Rebuild,
        UpdateName::Refit => Update::Refit,
        UpdateName::Async => Update::Async(pipeline::Pace::Free),
        UpdateName::TSah => Update::TSah,
        UpdateName::DeviceRebuild => Update::DeviceRebuild,
        UpdateName::Auto => return Err(Stop::bad("auto is no policy to compare with others")),
    })
}

/// A policy's name on the command line.
pub(crate) fn name(update: UpdateName) -> &'static str {
    policy(update).map_or("auto", choose::update_name)
}

/// A layout's name on the command line.
pub(crate) fn layout_name(layout: LayoutName) -> String {
    let value = layout.to_possible_value();
    value.map_or(String::new(), |v| v.get_name().to_owned())
}

/// What was seen of frames so far.
#[derive(Default)]
struct Seen {
    walls: Vec<f64>,
    geometry: Vec<f64>,
    trace: Vec<f64>,
    build_ms: Option<f64>,
    device_bytes: Option<DeviceBytes>,
    warm_up: Option<Warmed>,
    cut_short: bool,
}

/// Why frames end early.
enum Halt {
    Stop(Stop),
    Enough,
}

impl From<PipelineError> for Halt {
    fn from(e: PipelineError) -> Self {
        Self::Stop(e.into())
    }
}

impl Seen {
    fn run(
        &mut self,
        driver: &mut Driver,
        frames: &[Frame],
        query: Query<'_>,
        setting: &Setting<'_>,
    ) -> Result<(), Stop> {
        let first = |record: &FrameRecord| {
            self.note(record);
            Ok::<(), Stop>(())
        };
        let (warm_up, rest) = setting.warm_up.begin(driver, frames, query, first)?;
        self.warm_up = warm_up;
        let mut begun = None;
        let done = driver.run(rest.iter().copied(), query, false, |record, _| {
            self.note(record);
            // The first frame's build has a limit of its own.
            let begun = begun.get_or_insert_with(Instant::now);
            match self.walls.len() > 2 && begun.elapsed() > setting.patience {
                true => Err(Halt::Enough),
                false => Ok(()),
            }
        });
        match done {
            Ok(()) => Ok(()),
            Err(Halt::Stop(stop)) => Err(stop),
            Err(Halt::Enough) => {
                while driver.finish(None)?.is_some() {}
                self.cut_short = true;
                Ok(())
            }
        }
    }

    fn note(&mut self, record: &FrameRecord) {
        if self.walls.is_empty() {
            self.build_ms = record.adopted.map(|a| a.build_ms + a.convert_ms);
        } else {
            let t = &record.report.times;
            let sum = |all: &[Option<f64>]| all.iter().flatten().copied().reduce(|a, b| a + b);
            let stages = [t.interpolate_ms, t.preprocess_ms, t.rebuild_ms, t.refit_ms];
            self.geometry.extend(sum(&stages));
            self.trace
                .extend(sum(&[t.trace_primary_ms, t.trace_shadow_ms]));
        }
        self.walls.push(record.wall_ms);
        self.device_bytes = memory::larger(self.device_bytes, record.device_bytes);
    }

    fn sum_up(&self, device: Device, builder_threads: usize) -> Timing {
        let median = |all: &[f64]| Summary::of(all.iter().copied()).map(|s| s.median);
        let first_ms = self.walls.first().copied().unwrap_or(f64::NAN);
        let rest = self.walls.get(1..).unwrap_or_default();
        Timing {
            device,
            builder_threads,
            frame_ms: mean_of_medians(rest, PARTS).unwrap_or(first_ms),
            geometry_ms: median(&self.geometry),
            trace_ms: median(&self.trace),
            first_ms,
            build_ms: self.build_ms,
            device_bytes: self.device_bytes,
            warm_up: self.warm_up,
            frames: self.walls.len(),
            cut_short: self.cut_short,
        }
    }
}

/// The mean over so many parts of a run of each one's median: no part is left out, and a frame that something else
/// held up counts for nothing.
fn mean_of_medians(all: &[f64], parts: usize) -> Option<f64> {
    let chunks = all.chunks(all.len().div_ceil(parts).max(1));
    let medians = chunks.filter_map(|part| Summary::of(part.iter().copied()));
    let medians: Vec<f64> = medians.map(|s| s.median).collect();
    (!medians.is_empty()).then(|| medians.iter().sum::<f64>() / medians.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_turn_round_at_both_ends() {
        let times = |end, speed, count| -> Vec<f64> {
            let all = ping_pong(end, speed, count);
            all.iter().map(|f| f.time).collect()
        };
        assert_eq!(
            times(2.0, 0.5, 10),
            [0.0, 0.5, 1.0, 1.5, 2.0, 1.5, 1.0, 0.5, 0.0, 0.5]
        );
        assert_eq!(times(1.0, 0.75, 4), [0.0, 0.75, 0.5, 0.25]);
        assert_eq!(times(0.0, 0.5, 3), [0.0; 3]);
    }

    #[test]
    fn a_slow_part_counts_and_a_slow_frame_does_not() {
        let mut all = vec![1.0; 80];
        assert_eq!(mean_of_medians(&all, 8), Some(1.0));
        all[5] = 700.0;
        assert_eq!(mean_of_medians(&all, 8), Some(1.0));
        all[..10].fill(9.0);
        assert_eq!(mean_of_medians(&all, 8), Some(2.0));
        assert_eq!(mean_of_medians(&[3.0], 8), Some(3.0));
        assert_eq!(mean_of_medians(&[], 8), None);
    }

    /// Patience ends a run, but never before there is something to tell.
    #[test]
    fn patience_ends_a_run_with_something_to_tell() {
        let scene = scene::open("demo:twist:300", &scene::Options::default()).unwrap();
        let frames = ping_pong(scene.animation.end(), 0.5, 40);
        let time = |patience, update| {
            let setting = Setting {
                backend: BackendName::Cpu,
                adapter: None,
                size: [16, 9],
                warm_up: WarmUp::NONE,
                patience,
            };
            let way = Way {
                update,
                layout: LayoutName::Bvh2,
                builder_threads: Some(1),
            };
            super::time(&setting, &scene.animation, &frames, way)
        };
        let whole = time(Duration::MAX, UpdateName::Async).unwrap();
        assert!(!whole.cut_short && whole.frames == 40 && whole.builder_threads == 1);
        assert!(whole.build_ms.is_some() && whole.trace_ms.is_some() && whole.frame_ms > 0.0);
        let cut = time(Duration::ZERO, UpdateName::Refit).unwrap();
        assert!(
            cut.cut_short && cut.frames < 10 && cut.frame_ms > 0.0,
            "{cut:?}"
        );
        assert!(time(Duration::MAX, UpdateName::DeviceRebuild).is_err());
        assert!(time(Duration::MAX, UpdateName::Auto).is_err());
    }
}
