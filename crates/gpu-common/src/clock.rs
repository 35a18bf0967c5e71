//! Stages, and their times by the device's clock.

use backend::StageTimes;

/// A stage of a frame, in order of execution. A tree build runs partly before and partly after `Preprocess`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Blends key frames to positions.
    Interpolate,
    /// Computes triangle records and boxes of leaves from positions.
    Preprocess,
    /// Builds a tree from positions.
    Rebuild,
    /// Computes boxes of inner nodes from boxes of leaves.
    Refit,
    /// Traces primary rays.
    TracePrimary,
    /// Traces shadow rays.
    TraceShadow,
}

impl Stage {
    fn of(self, times: &mut StageTimes) -> &mut f64 {
        let time = match self {
            Self::Interpolate => &mut times.interpolate_ms,
            Self::Preprocess => &mut times.preprocess_ms,
            Self::Rebuild => &mut times.rebuild_ms,
            Self::Refit => &mut times.refit_ms,
            Self::TracePrimary => &mut times.trace_primary_ms,
            Self::TraceShadow => &mut times.trace_shadow_ms,
        };
        time.get_or_insert(0.0)
    }
}

/// Converts differences of timestamps into milliseconds. Only the low bits of a timestamp count.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    mask: u64,
    tick_ns: f64,
}

impl Clock {
    /// Creates a clock with `bits` valid bits and `tick_ns` nanoseconds per tick.
    pub fn new(bits: u32, tick_ns: f64) -> Self {
        let mask = 1_u64.checked_shl(bits);
        Self {
            mask: mask.map_or(u64::MAX, |beyond| beyond - 1),
            tick_ns,
        }
    }

    /// Returns the times of a submission. `marks` names the stage that starts at each timestamp. If a stage ran
    /// twice, both times are added. The time of an `idle` stage is 0.
    pub(crate) fn times(
        &self,
        marks: &[Option<Stage>],
        ticks: &[u64],
        idle: &[Stage],
    ) -> StageTimes {
        let mut times = StageTimes::default();
        let ticks = &ticks[..marks.len().min(ticks.len())];
        let (Some(&first), Some(&end)) = (ticks.first(), ticks.last()) else {
            return times;
        };
        times.device_ms = self.ms(self.between(first, end));
        for (stage, pair) in marks.iter().zip(ticks.windows(2)) {
            if let Some(stage) = stage {
                *stage.of(&mut times) += self.ms(self.between(pair[0], pair[1]));
            }
        }
        for stage in idle {
            stage.of(&mut times);
        }
        times
    }

    /// Returns the ticks from one timestamp to a later one, even if the clock wrapped in between. 64-bit clocks do not
    /// wrap.
    fn between(&self, from: u64, to: u64) -> u64 {
        match self.mask {
            u64::MAX => to.saturating_sub(from),
            mask => to.wrapping_sub(from) & mask,
        }
    }

    fn ms(&self, ticks: u64) -> f64 {
        ticks as f64 * self.tick_ns * 1e-6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REFIT: Option<Stage> = Some(Stage::Refit);

    #[test]
    fn times_adjacent_and_separate_stages() {
        let interpolate = Some(Stage::Interpolate);
        let clock = Clock::new(64, 0.5);
        let check = |marks: &[Option<Stage>], ticks: &[u64]| {
            let times = clock.times(marks, ticks, &[Stage::TracePrimary]);
            assert_eq!(times.interpolate_ms, Some(0.5));
            assert_eq!(times.refit_ms, Some(3.5));
            assert_eq!(times.preprocess_ms, None);
            assert_eq!(times.trace_primary_ms, Some(0.0));
            times.device_ms
        };
        // First with adjacent stages, one of them twice; then with untimed work between the stages.
        let joined = [interpolate, REFIT, REFIT, None];
        let ticks = [1_000_000, 2_000_000, 5_000_000, 9_000_000, 7, 7];
        assert_eq!(check(&joined, &ticks), 4.0);
        let apart = [interpolate, None, REFIT, None];
        let ticks = [11_000_000, 12_000_000, 13_000_000, 20_000_000];
        assert_eq!(check(&apart, &ticks), 4.5);
    }

    #[test]
    fn narrow_clock_handles_wraparound() {
        let clock = Clock::new(20, 1e6);
        let wrap = 1_u64 << 20;
        let garbage = 7 << 40;
        for from in [wrap - 3, wrap + 10] {
            let ticks = [garbage | (from % wrap), (from + 5) % wrap];
            let times = clock.times(&[REFIT, None], &ticks, &[]);
            assert_eq!((times.refit_ms, times.device_ms), (Some(5.0), 5.0));
        }
    }

    #[test]
    fn wide_clock_keeps_every_tick() {
        // Nanoseconds since 1970 do not fit into the mantissa of an f64.
        let start = 1_800_000_000_000_000_001_u64;
        let clock = Clock::new(64, 1.0);
        let times = clock.times(&[REFIT, None], &[start, start + 1], &[]);
        assert_eq!(times.refit_ms, Some(1e-6));
    }

    #[test]
    fn missing_marks_yield_no_times() {
        let clock = Clock::new(64, 1.0);
        assert_eq!(clock.times(&[REFIT], &[], &[]), StageTimes::default());
        assert_eq!(clock.times(&[None], &[5], &[]), StageTimes::default());
    }
}
