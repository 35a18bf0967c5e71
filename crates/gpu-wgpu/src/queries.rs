//! When each stage began and ended, by the device's clock.

use crate::buffers::make;
use crate::device::Gpu;
use backend::{Result, StageTimes};
use wgpu::{Buffer, BufferUsages, CommandEncoder, ComputePassTimestampWrites, QuerySet};

/// Passes of one submission that are timed; those beyond are not.
const PASSES: u32 = 16;
/// Bytes of all timestamps.
pub(crate) const BYTES: u64 = PASSES as u64 * 16;

/// A stage of a frame, in order; each is one compute pass.
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

/// Two timestamps a pass.
pub(crate) struct Clock {
    set: QuerySet,
    resolved: Buffer,
}

impl Clock {
    /// `None` where the device has no timestamps.
    pub(crate) fn new(gpu: &Gpu) -> Result<Option<Self>> {
        if !gpu.has_timestamps() {
            return Ok(None);
        }
        let desc = wgpu::QuerySetDescriptor {
            label: Some("timestamps"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * PASSES,
        };
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        Ok(Some(Self {
            set: gpu.guard("timestamps", 0, || gpu.device.create_query_set(&desc))?,
            resolved: make(gpu, "timestamps", BYTES, usage)?,
        }))
    }

    /// What the `pass`-th pass of a submission writes.
    pub(crate) fn writes(&self, pass: usize) -> Option<ComputePassTimestampWrites<'_>> {
        let pass = u32::try_from(pass).ok().filter(|&p| p < PASSES)?;
        Some(ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(2 * pass),
            end_of_pass_write_index: Some(2 * pass + 1),
        })
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.resolved.size()
    }

    /// Records that the timestamps of the first `passes` go to `back`, from byte `at` on.
    pub(crate) fn resolve(
        &self,
        encoder: &mut CommandEncoder,
        passes: usize,
        back: &Buffer,
        at: u64,
    ) {
        let marks = 2 * PASSES.min(passes as u32);
        if marks > 0 {
            encoder.resolve_query_set(&self.set, 0..marks, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, back, at, u64::from(marks) * 8);
        }
    }
}

/// Times of stages from their timestamps, of `tick_ns` nanoseconds each. A stage run twice counts twice; those that had
/// nothing to do took no time.
pub(crate) fn times(stages: &[Stage], idle: &[Stage], ticks: &[u64], tick_ns: f64) -> StageTimes {
    let ms = |from: u64, to: u64| to.saturating_sub(from) as f64 * tick_ns * 1e-6;
    let mut times = StageTimes::default();
    let marks: Vec<_> = ticks.chunks_exact(2).take(stages.len()).collect();
    for (stage, mark) in stages.iter().zip(&marks) {
        *stage.of(&mut times).get_or_insert(0.0) += ms(mark[0], mark[1]);
    }
    for stage in idle {
        stage.of(&mut times).get_or_insert(0.0);
    }
    if let (Some(first), Some(last)) = (marks.first(), marks.last()) {
        times.device_ms = ms(first[0], last[1]);
        times.begun_ms = Some(ms(0, first[0]));
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_timed_each_and_all_together() {
        let (stages, idle) = ([Stage::Interpolate, Stage::Refit], [Stage::TracePrimary]);
        let ticks = [1_000_000, 2_000_000, 5_000_000, 9_000_000, 7, 7];
        let times = times(&stages, &idle, &ticks, 0.5);
        assert_eq!(times.interpolate_ms, Some(0.5));
        assert_eq!(times.refit_ms, Some(2.0));
        assert_eq!(times.preprocess_ms, None);
        assert_eq!(times.trace_primary_ms, Some(0.0));
        assert!((times.device_ms - 4.0).abs() < 1e-12);
        assert_eq!(times.begun_ms, Some(0.5));
    }
}
