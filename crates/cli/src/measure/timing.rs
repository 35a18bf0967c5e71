//! Times and hits of frames that a driver traces.

use crate::error::CliError;
use backend::{Hits, Query};
use pipeline::{Driver, Frame, FrameOutputs, FrameRecord, OutputSelection, Warmed};

/// Frames to time.
#[derive(Clone, Copy)]
pub(super) struct TimingPlan<'a> {
    pub(super) frames: &'a [Frame],
    pub(super) query: Query<'a>,
    /// Seconds of warm-up after the first frame, or `None` for the default of the kind of device.
    pub(super) warm_up: Option<f64>,
}

/// The times of a run's frames.
#[derive(Default)]
pub(super) struct TimedFrames {
    pub(super) warm_up: Option<Warmed>,
    pub(super) stats: Vec<FrameRecord>,
}

impl TimedFrames {
    /// Adds a frame, with the resident memory of the process.
    pub(super) fn add(&mut self, frame: FrameRecord) {
        self.stats.push(FrameRecord {
            host_bytes: host::resident(),
            ..frame
        });
    }
}

pub(super) fn time_frames(
    driver: &mut Driver,
    plan: TimingPlan<'_>,
) -> Result<TimedFrames, CliError> {
    let TimingPlan { frames, query, .. } = plan;
    let mut timed = TimedFrames::default();
    let mut add = |frame: &FrameRecord| {
        timed.add(frame.clone());
        Ok::<(), CliError>(())
    };
    let (warm_up, rest) = driver.warm_up(plan.warm_up, frames, query, &mut add)?;
    let rest = rest.iter().copied();
    driver.run(rest, query, OutputSelection::default(), |frame, _| {
        add(frame)
    })?;
    Ok(TimedFrames { warm_up, ..timed })
}

/// Traces one frame and returns its hits.
pub(super) fn trace_frame(
    driver: &mut Driver,
    frame: Frame,
    query: Query<'_>,
) -> Result<Hits, CliError> {
    let mut found = FrameOutputs::default();
    driver.begin(frame, &[query])?;
    driver.finish(OutputSelection::HITS, &mut found)?;
    Ok(found.hits)
}
