//! When each stage began and ended, by the device's clock.

use crate::device::Gpu;
use crate::errors::failed;
use ash::vk;
use backend::{Result, StageTimes};
use std::sync::Arc;

/// Marks of one query pool; more marks take more pools.
const MARKS: usize = 16;

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

/// The timestamps of one submission: one at its begin, one at each stage's end.
pub(crate) struct Marks {
    pools: Vec<vk::QueryPool>,
    used: usize,
    gpu: Arc<Gpu>,
}

impl Marks {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        Self {
            pools: Vec::new(),
            used: 0,
            gpu: Arc::clone(gpu),
        }
    }

    /// Forgets the marks of the submission before, which must be finished.
    pub(crate) fn reset(&mut self) {
        self.used = 0;
    }

    /// Records a mark: the time at which all that was recorded before is done.
    pub(crate) fn mark(&mut self, commands: vk::CommandBuffer) -> Result<()> {
        if self.gpu.timestamp_bits == 0 {
            return Ok(());
        }
        let (page, query) = (self.used / MARKS, (self.used % MARKS) as u32);
        if page == self.pools.len() {
            self.pools.push(query_pool(&self.gpu)?);
        }
        let pool = self.pools[page];
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded; queries are reset in it before they are written.
        unsafe {
            if query == 0 {
                self.gpu
                    .vk
                    .cmd_reset_query_pool(commands, pool, 0, MARKS as u32);
            }
            self.gpu
                .vk
                .cmd_write_timestamp(commands, stage, pool, query);
        }
        self.used += 1;
        Ok(())
    }

    /// All marks of a finished submission.
    pub(crate) fn read(&self) -> Result<Vec<u64>> {
        let mut ticks = vec![0_u64; self.used];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        for (ticks, &pool) in ticks.chunks_mut(MARKS).zip(&self.pools) {
            // SAFETY: the submission is finished, so these queries were written.
            unsafe { self.gpu.vk.get_query_pool_results(pool, 0, ticks, flags) }
                .map_err(failed("timestamps"))?;
        }
        Ok(ticks)
    }
}

fn query_pool(gpu: &Gpu) -> Result<vk::QueryPool> {
    let info = vk::QueryPoolCreateInfo::default()
        .query_type(vk::QueryType::TIMESTAMP)
        .query_count(MARKS as u32);
    // SAFETY: the device is alive and `info` outlives the call.
    unsafe { gpu.vk.create_query_pool(&info, None) }.map_err(failed("timestamps"))
}

impl Drop for Marks {
    fn drop(&mut self) {
        for &pool in &self.pools {
            // SAFETY: the backend waits for the device before it drops its slots.
            unsafe { self.gpu.vk.destroy_query_pool(pool, None) };
        }
    }
}

/// Turns ticks, of which only some bits count, into milliseconds since the
/// first submission. Submissions are shown in their order and oftener than the
/// ticks wrap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    mask: u64,
    tick_ns: f64,
    /// The last submission's first mark, and how long after the very first one it was.
    last: Option<(u64, u64)>,
}

impl Clock {
    pub(crate) fn new(timestamp_bits: u32, tick_ns: f64) -> Self {
        let mask = 1_u64.checked_shl(timestamp_bits);
        Self {
            mask: mask.map_or(u64::MAX, |beyond| beyond - 1),
            tick_ns,
            last: None,
        }
    }

    /// The times of the next submission from its stages and marks. A stage run twice counts twice.
    pub(crate) fn times(&mut self, stages: &[Stage], marks: &[u64]) -> StageTimes {
        let mut times = StageTimes::default();
        let (Some(&first), Some(&end)) = (marks.first(), marks.last()) else {
            return times;
        };
        let since = self.since_the_first(first);
        times.begun_ms = (!stages.is_empty()).then(|| self.ms(since));
        times.device_ms = self.ms(self.between(first, end));
        for (stage, pair) in stages.iter().zip(marks.windows(2)) {
            let total = match stage {
                Stage::Interpolate => &mut times.interpolate_ms,
                Stage::Preprocess => &mut times.preprocess_ms,
                Stage::Rebuild => &mut times.rebuild_ms,
                Stage::Refit => &mut times.refit_ms,
                Stage::TracePrimary => &mut times.trace_primary_ms,
                Stage::TraceShadow => &mut times.trace_shadow_ms,
            };
            *total = Some(total.unwrap_or(0.0) + self.ms(self.between(pair[0], pair[1])));
        }
        times
    }

    fn since_the_first(&mut self, tick: u64) -> u64 {
        let (last, since) = self.last.unwrap_or((tick, 0));
        let since = since + self.between(last, tick);
        self.last = Some((tick, since));
        since
    }

    /// Ticks from one mark to a later one, though they wrapped meanwhile.
    fn between(&self, from: u64, to: u64) -> u64 {
        to.wrapping_sub(from) & self.mask
    }

    fn ms(&self, ticks: u64) -> f64 {
        ticks as f64 * self.tick_ns * 1e-6
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn stages_are_timed_each_and_all_together() {
        let stages = [Stage::Interpolate, Stage::Refit, Stage::Refit];
        let mut clock = Clock::new(64, 0.5);
        let times = clock.times(&stages, &[1_000_000, 2_000_000, 5_000_000, 9_000_000]);
        assert_eq!(times.interpolate_ms, Some(0.5));
        assert_eq!(times.refit_ms, Some(3.5));
        assert_eq!(times.preprocess_ms, None);
        assert_eq!((times.device_ms, times.begun_ms), (4.0, Some(0.0)));
    }

    pub(crate) fn a_clock_of_few_bits_goes_on_when_it_wraps() {
        let mut clock = Clock::new(20, 1e6);
        let wrap = 1_u64 << 20;
        let garbage = 7 << 40;
        let stage = [Stage::Interpolate];
        let mut begun = |from: u64| {
            let marks = [garbage | (from % wrap), (from + 5) % wrap];
            let times = clock.times(&stage, &marks);
            assert_eq!((times.interpolate_ms, times.device_ms), (Some(5.0), 5.0));
            times.begun_ms.unwrap()
        };
        let starts = [wrap - 3, wrap + 10, 2 * wrap - 1, 2 * wrap + 7, 3 * wrap];
        for start in starts {
            assert_eq!(begun(start), (start - (wrap - 3)) as f64);
        }
    }

    pub(crate) fn a_clock_of_64_bits_keeps_every_tick() {
        // Nanoseconds since 1970 have more bits than an f64.
        let start = 1_800_000_000_000_000_001_u64;
        let mut clock = Clock::new(64, 1.0);
        clock.times(&[Stage::Refit], &[start, start + 1]);
        let times = clock.times(&[Stage::Refit], &[start + 3_000_001, start + 3_000_002]);
        let close = |found: Option<f64>, ms: f64| (found.unwrap() - ms).abs() < 1e-9;
        assert!(close(times.begun_ms, 3.000_001), "{times:?}");
        assert!(close(times.refit_ms, 0.000_001), "{times:?}");
    }

    pub(crate) fn nothing_is_timed_without_marks_nor_begun_without_stages() {
        let mut clock = Clock::new(64, 1.0);
        assert_eq!(clock.times(&[Stage::Refit], &[]), StageTimes::default());
        assert_eq!(clock.times(&[], &[5]), StageTimes::default());
    }
}
