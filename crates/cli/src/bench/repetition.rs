//! Frames timed again and again while the scene stands still.
//!
//! With `rebuild` the device has nothing to do while the host builds, and its clock falls: what it then takes for a frame
//! says little of the tree. So that very frame is done over and over ([`pipeline::Driver::repeat`]) until its times are
//! those of a device at work.

use crate::table::{FRAMES, counted};
use crate::warm_up::agree;
use backend::{FrameReport, Query, StageTimes};
use pipeline::{Driver, Frame, Pace, PipelineError, Update};
use report::{FrameStats, Summary};
use serde::Serialize;
use std::time::Instant;

/// Times of the stretch asked for after which a frame is left, whether its times agree or not.
const PATIENCE: f64 = 2.0;

/// How long each frame is done again, and which frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameRepetition {
    /// Seconds; more than none.
    seconds: f64,
    /// Of so many frames, the first.
    every: usize,
}

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct RepeatedFrames {
    /// Seconds at each frame, as asked for.
    seconds: f64,
    /// All that was done again.
    repeats: usize,
    /// Frames whose times still changed in the end.
    pub(super) unsteady: usize,
}

impl FrameRepetition {
    /// So many seconds at every so-manieth frame; `None` for none.
    pub(crate) fn asked(seconds: f64, every: usize) -> Option<Self> {
        (seconds > 0.0).then_some(Self { seconds, every })
    }

    /// The same, if trees stay what they are while a frame is done again.
    pub(super) fn fits(self, update: Update) -> Option<Self> {
        match update {
            Update::Async(Pace::Free | Pace::Lockstep(_)) => None,
            Update::Rebuild | Update::Refit | Update::TSah | Update::DeviceRebuild => Some(self),
        }
    }

    /// Those of `frames` that are dwelt on.
    pub(super) fn frames(self, frames: &[Frame]) -> Vec<Frame> {
        frames.iter().copied().step_by(self.every).collect()
    }

    /// Nothing dwelt on so far.
    pub(super) fn begin(self) -> RepeatedFrames {
        RepeatedFrames {
            seconds: self.seconds,
            repeats: 0,
            unsteady: 0,
        }
    }
}

impl RepeatedFrames {
    /// Does the driver's last frame again for a while; puts the device's times at the end of it into the frame's row.
    pub(super) fn at(
        &mut self,
        driver: &mut Driver,
        query: Query<'_>,
        row: &mut FrameStats,
    ) -> Result<(), PipelineError> {
        let begun = Instant::now();
        let mut seen = Seen::default();
        driver.repeat(query, |report: &FrameReport| {
            seen.0.push((begun.elapsed().as_secs_f64(), report.times));
            let last = begun.elapsed().as_secs_f64();
            last < self.seconds || (last < PATIENCE * self.seconds && !seen.is_steady())
        })?;
        self.repeats += seen.0.len();
        self.unsteady += usize::from(!seen.is_steady());
        seen.put_into(row);
        Ok(())
    }

    /// What to say of frames that took long to come to rest.
    pub(super) fn warning(self) -> Option<String> {
        let (unsteady, seconds) = (self.unsteady, self.seconds);
        (unsteady > 0).then(|| {
            let frames = counted(unsteady, FRAMES);
            format!("{frames} still changed after {seconds} s each: dwell longer")
        })
    }
}

/// When a frame was done, in seconds since the first began, and the device's times of it.
#[derive(Default)]
struct Seen(Vec<(f64, StageTimes)>);

impl Seen {
    /// Those after so large a share of the time up to now.
    fn after(&self, share: f64) -> &[(f64, StageTimes)] {
        let end = self.0.last().map_or(0.0, |&(at, _)| at);
        let first = self.0.partition_point(|&(at, _)| at < share * end);
        &self.0[first..]
    }

    /// Whether the last quarter's frames took as long as those of the quarter before.
    fn is_steady(&self) -> bool {
        let (half, last) = (self.after(0.5), self.after(0.75));
        let before = &half[..half.len() - last.len()];
        let ms = |of: &[(f64, StageTimes)]| of.iter().map(|(_, t)| t.device_ms).collect::<Vec<_>>();
        agree(&ms(before), &ms(last))
    }

    /// Medians of the last half stand for the frame.
    fn put_into(&self, row: &mut FrameStats) {
        let half = self.after(0.5);
        let median = |time: fn(&StageTimes) -> Option<f64>| {
            Summary::of(half.iter().filter_map(|(_, t)| time(t))).map(|s| s.median)
        };
        row.interpolate_ms = median(|t| t.interpolate_ms);
        row.preprocess_ms = median(|t| t.preprocess_ms);
        row.rebuild_ms = median(|t| t.rebuild_ms);
        row.refit_ms = median(|t| t.refit_ms);
        row.trace_primary_ms = median(|t| t.trace_primary_ms);
        row.trace_shadow_ms = median(|t| t.trace_shadow_ms);
        row.device_ms = median(|t| Some(t.device_ms));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of so many milliseconds each, one after the other, a fifth of it for rays.
    fn seen(ms: impl IntoIterator<Item = f64>) -> Seen {
        let mut now = 0.0;
        let frame = |ms: f64| {
            now += ms * 1e-3;
            let times = StageTimes {
                refit_ms: Some(0.8 * ms),
                trace_primary_ms: Some(0.2 * ms),
                device_ms: ms,
                ..StageTimes::default()
            };
            (now, times)
        };
        Seen(ms.into_iter().map(frame).collect())
    }

    #[test]
    fn medians_of_the_last_half_of_the_time_stand_for_the_frame() {
        let mut row = FrameStats {
            interpolate_ms: Some(7.0),
            wall_ms: Some(9.0),
            ..FrameStats::default()
        };
        // 200 ms at a low clock, then 300 ms at a high one, with one frame held up.
        let mut ms = [vec![4.0; 50], vec![1.0; 300]].concat();
        ms[300] = 30.0;
        seen(ms).put_into(&mut row);
        let found = [row.interpolate_ms, row.trace_primary_ms, row.device_ms];
        assert_eq!(found, [None, Some(0.2), Some(1.0)]);
        assert_eq!((row.refit_ms, row.wall_ms), (Some(0.8), Some(9.0)));
    }

    #[test]
    fn a_frame_is_at_rest_once_the_last_two_quarters_agree() {
        assert!(seen(vec![1.0; 40]).is_steady());
        assert!(!seen([]).is_steady() && !seen(vec![1.0; 8]).is_steady());
        let rising = [vec![4.0; 50], vec![1.0; 70]].concat();
        assert!(!seen(rising.clone()).is_steady());
        assert!(seen([rising, vec![1.0; 200]].concat()).is_steady());
    }

    #[test]
    fn nobody_dwells_while_trees_are_built() {
        let dwell = FrameRepetition::asked(0.1, 3).unwrap();
        assert_eq!(FrameRepetition::asked(0.0, 3), None);
        assert_eq!(dwell.fits(Update::Rebuild), Some(dwell));
        assert_eq!(dwell.fits(Update::Async(Pace::Free)), None);
        let frames = |n: u64| (0..n).map(|index| Frame { index, time: 0.5 });
        let all: Vec<Frame> = frames(7).collect();
        let kept: Vec<u64> = dwell.frames(&all).iter().map(|f| f.index).collect();
        assert_eq!(kept, [0, 3, 6]);
    }
}
