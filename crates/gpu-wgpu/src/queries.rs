//! When each stage began and ended, by the device's clock.

use crate::buffers::make;
use crate::device::Gpu;
use backend::{Result, StageTimes};
use wgpu::{
    Buffer, BufferUsages, CommandEncoder, ComputePass, ComputePassTimestampWrites, Features,
    QuerySet,
};

/// Timestamps of one submission; what comes after the last of them is not timed.
const MARKS: usize = 32;
/// Bytes of all timestamps.
pub(crate) const BYTES: u64 = MARKS as u64 * 8;

/// What lets stages share a pass and still be timed each.
pub(crate) const WITHIN_PASSES: Features = Features::TIMESTAMP_QUERY_INSIDE_PASSES;

/// A stage of a frame, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Interpolate,
    Preprocess,
    Rebuild,
    Refit,
    TracePrimary,
    TraceShadow,
}

impl Stage {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Interpolate => "interpolate",
            Self::Preprocess => "preprocess",
            Self::Rebuild => "rebuild",
            Self::Refit => "refit",
            Self::TracePrimary => "trace",
            Self::TraceShadow => "trace shadows",
        }
    }

    fn of(self, times: &mut StageTimes) -> &mut Option<f64> {
        match self {
            Self::Interpolate => &mut times.interpolate_ms,
            Self::Preprocess => &mut times.preprocess_ms,
            Self::Rebuild => &mut times.rebuild_ms,
            Self::Refit => &mut times.refit_ms,
            Self::TracePrimary => &mut times.trace_primary_ms,
            Self::TraceShadow => &mut times.trace_shadow_ms,
        }
    }
}

/// Timestamps, and what runs from each of them on.
pub(crate) struct Clock {
    set: QuerySet,
    resolved: Buffer,
    /// Whether passes take timestamps between their dispatches, so that stages can share a pass.
    within: bool,
    marks: Vec<Option<Stage>>,
}

impl Clock {
    /// `None` where the device has no timestamps.
    pub(crate) fn new(gpu: &Gpu) -> Result<Option<Self>> {
        if !gpu.features.contains(Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let desc = wgpu::QuerySetDescriptor {
            label: Some("timestamps"),
            ty: wgpu::QueryType::Timestamp,
            count: MARKS as u32,
        };
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        Ok(Some(Self {
            set: gpu.guard("timestamps", 0, || gpu.device.create_query_set(&desc))?,
            resolved: make(gpu, "timestamps", BYTES, usage)?,
            within: gpu.features.contains(WITHIN_PASSES),
            marks: Vec::with_capacity(MARKS),
        }))
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.resolved.size()
    }

    /// Whether stages can share a pass.
    pub(crate) fn marks_within(&self) -> bool {
        self.within
    }

    /// Forgets what was timed.
    pub(crate) fn begin(&mut self) {
        self.marks.clear();
    }

    /// The first of the timestamps for a pass: one before each of its stages, and one behind them. None if too few are left.
    pub(crate) fn take(&mut self, stages: impl ExactSizeIterator<Item = Stage>) -> Option<u32> {
        let first = self.marks.len();
        (first + stages.len() < MARKS).then(|| {
            self.marks.extend(stages.map(Some).chain([None]));
            first as u32
        })
    }

    /// Before and behind a pass of so many stages. Such timestamps take 2 us less than those within (an H200).
    pub(crate) fn around(&self, first: u32, stages: usize) -> ComputePassTimestampWrites<'_> {
        ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + stages as u32),
        }
    }

    /// Before the `i`-th stage of a pass, but the first.
    pub(crate) fn mark(&self, pass: &mut ComputePass<'_>, first: u32, i: usize) {
        if i > 0 {
            pass.write_timestamp(&self.set, first + i as u32);
        }
    }

    /// Records that the timestamps go to `back`, from byte `at` on.
    pub(crate) fn resolve(&self, encoder: &mut CommandEncoder, back: &Buffer, at: u64) {
        let marks = self.marks.len() as u32;
        if marks > 0 {
            encoder.resolve_query_set(&self.set, 0..marks, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, back, at, u64::from(marks) * 8);
        }
    }

    /// Times of stages from the timestamps that came back, of `tick_ns` nanoseconds each; `idle` had nothing to do.
    pub(crate) fn times(&self, idle: &[Stage], ticks: &[u64], tick_ns: f64) -> StageTimes {
        times((&self.marks, idle), ticks, tick_ns)
    }
}

/// A stage that ran twice counts twice; those that had nothing to do took no time.
fn times((marks, idle): (&[Option<Stage>], &[Stage]), ticks: &[u64], tick_ns: f64) -> StageTimes {
    let ms = |from: u64, to: u64| to.saturating_sub(from) as f64 * tick_ns * 1e-6;
    let mut times = StageTimes::default();
    let ticks = &ticks[..marks.len()];
    for (stage, span) in marks.iter().zip(ticks.windows(2)) {
        if let Some(stage) = stage {
            *stage.of(&mut times).get_or_insert(0.0) += ms(span[0], span[1]);
        }
    }
    for stage in idle {
        stage.of(&mut times).get_or_insert(0.0);
    }
    if let (Some(&first), Some(&last)) = (ticks.first(), ticks.last()) {
        times.device_ms = ms(first, last);
        times.begun_ms = Some(ms(0, first));
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_timed_each_and_all_together() {
        let idle = [Stage::TracePrimary];
        let check = |marks: &[Option<Stage>], ticks: &[u64]| {
            let times = times((marks, &idle), ticks, 0.5);
            assert_eq!(times.interpolate_ms, Some(0.5));
            assert_eq!(times.refit_ms, Some(2.0));
            assert_eq!(times.preprocess_ms, None);
            assert_eq!(times.trace_primary_ms, Some(0.0));
            assert_eq!(times.begun_ms, Some(0.5));
            times.device_ms
        };
        let [interpolate, refit] = [Stage::Interpolate, Stage::Refit].map(Some);
        // A pass each, with something between them; one pass, in which one stage follows the other.
        let apart = [interpolate, None, refit, None];
        let ticks = [1_000_000, 2_000_000, 5_000_000, 9_000_000, 7, 7];
        assert!((check(&apart, &ticks) - 4.0).abs() < 1e-12);
        let ticks = [1_000_000, 2_000_000, 6_000_000, 7];
        assert!((check(&[interpolate, refit, None], &ticks) - 2.5).abs() < 1e-12);
    }
}
