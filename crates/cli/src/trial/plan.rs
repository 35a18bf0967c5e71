//! Which frames of a run stand for all of it.

use report::Summary;
use std::ops::Range;

/// Frames to run, and how what they take is summed up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Frames that follow each other, in the order in which they are run.
    pub(super) places: Vec<Range<usize>>,
    /// So many at each place's beginning are not timed.
    pub(super) warm: usize,
    /// So many of the others share a median.
    chunk: usize,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    /// Frames of the run.
    pub(super) frames: usize,
    /// Milliseconds of one.
    pub(super) frame_ms: f64,
    /// Milliseconds of a first tree's build.
    pub(super) build_ms: f64,
}

/// Places and frames timed at each, the most telling first; where a frame's time depends on its moment alone.
const SPREAD: [(usize, usize); 6] = [(8, 6), (6, 4), (6, 2), (3, 2), (2, 2), (1, 2)];
/// The same where it depends on what came before.
const STRETCHES: [(usize, usize); 5] = [(3, 16), (3, 8), (2, 6), (1, 6), (1, 3)];
/// The longest that a stretch warms up, in milliseconds.
const WARM_MS: f64 = 100.0;
/// Medians that a whole run is summed up by.
const PARTS: usize = 8;

impl Plan {
    /// Moments spread over the run, for so many policies in `allowance` milliseconds, if there is time for two first
    /// trees too; `None` if there is not. Who has no time left is left out later.
    pub(super) fn spread(allowance: f64, policies: usize, guess: Guess) -> Option<Self> {
        let fits = SPREAD.iter().find(|(places, timed)| {
            let frames = policies * (1 + places * (1 + timed));
            2.0 * guess.build_ms + frames as f64 * guess.frame_ms <= allowance
        });
        let &(places, timed) = fits?;
        Some(Self::lay(guess.frames, places, 1, timed))
    }

    /// The run as it is, if it takes but `allowance` milliseconds; else stretches of it, each with time for two builds before.
    pub(super) fn stretches(allowance: f64, guess: Guess) -> Self {
        let Guess {
            frames, frame_ms, ..
        } = guess;
        if frames as f64 * frame_ms <= allowance {
            return Self::whole(frames);
        }
        let warm = (2.0 * guess.build_ms).min(WARM_MS) / frame_ms.max(1e-3);
        let plan = |&(places, timed): &(usize, usize)| {
            (places, (warm.ceil() as usize).clamp(1, 4 * timed), timed)
        };
        let mut plans = STRETCHES.iter().map(plan);
        let fits = plans
            .find(|(places, warm, timed)| (places * (warm + timed)) as f64 * frame_ms <= allowance);
        let (places, warm, timed) = fits.unwrap_or((1, 1, STRETCHES[4].1));
        Self::lay(frames, places, warm, timed)
    }

    /// Every frame, the first one to warm up.
    fn whole(frames: usize) -> Self {
        Self {
            places: std::iter::once(0..frames).collect(),
            warm: 1,
            chunk: frames.saturating_sub(1).div_ceil(PARTS).max(1),
        }
    }

    /// Places in the middle of equal parts of the run, the last first: there a tree that ages is at its worst.
    fn lay(frames: usize, places: usize, warm: usize, timed: usize) -> Self {
        let long = warm + timed;
        if places * long >= frames {
            return Self::whole(frames);
        }
        let place = |i: usize| {
            let middle = (2 * i + 1) * frames / (2 * places);
            let start = middle.saturating_sub(long / 2).min(frames - long);
            start..start + long
        };
        Self {
            places: (0..places).rev().map(place).collect(),
            warm,
            chunk: timed,
        }
    }

    /// Medians that all places come to.
    pub(super) fn medians(&self) -> usize {
        let timed = self
            .places
            .iter()
            .map(|p| p.len().saturating_sub(self.warm));
        timed.map(|t| t.div_ceil(self.chunk)).sum()
    }

    /// Frames that are timed.
    pub(super) fn timed(&self) -> usize {
        let timed = self
            .places
            .iter()
            .map(|p| p.len().saturating_sub(self.warm));
        timed.sum()
    }

    /// Medians of what the frames of one place took.
    pub(super) fn sum_up(&self, walls: &[f64]) -> Vec<f64> {
        let timed = walls.get(self.warm..).unwrap_or_default();
        let median = |part: &[f64]| Summary::of(part.iter().copied()).map(|s| s.median);
        timed.chunks(self.chunk).filter_map(median).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guess(frames: usize, frame_ms: f64, build_ms: f64) -> Guess {
        Guess {
            frames,
            frame_ms,
            build_ms,
        }
    }

    #[test]
    fn a_spread_fits_the_time_or_there_is_none() {
        let all = Plan::spread(1500.0, 3, guess(200, 1.0, 5.0)).unwrap();
        assert_eq!((all.places.len(), all.timed(), all.medians()), (8, 48, 8));
        let few = Plan::spread(1500.0, 3, guess(48, 40.0, 10.0)).unwrap();
        assert_eq!((few.places.len(), few.timed()), (3, 6));
        assert_eq!(Plan::spread(1500.0, 3, guess(48, 500.0, 200.0)), None);
    }

    #[test]
    fn places_lie_apart_within_the_run_and_the_last_comes_first() {
        let plan = Plan::lay(60, 3, 2, 4);
        assert_eq!(plan.places, [47..53, 27..33, 7..13]);
        assert_eq!((plan.medians(), plan.timed()), (3, 12));
    }

    #[test]
    fn what_depends_on_what_came_before_is_run_as_it_is_if_there_is_time() {
        let whole = Plan::stretches(500.0, guess(120, 1.0, 90.0));
        assert_eq!(whole.places, Plan::whole(120).places);
        assert_eq!((whole.timed(), whole.medians()), (119, 8));
        let parts = Plan::stretches(100.0, guess(1000, 1.0, 5.0));
        assert_eq!((parts.places.len(), parts.warm), (3, 10));
        let least = Plan::stretches(1.0, guess(1000, 1.0, 5.0));
        assert_eq!((least.places.len(), least.timed()), (1, 3));
    }

    /// Otherwise a policy that is slow in a third of a run would pass for a fast one.
    #[test]
    fn all_parts_of_a_run_count() {
        let plan = Plan::whole(25);
        let walls: Vec<f64> = (0..25).map(|i| if i <= 8 { 7.0 } else { 1.0 }).collect();
        let medians = plan.sum_up(&walls);
        assert_eq!(medians.len(), 8);
        let mean = medians.iter().sum::<f64>() / 8.0;
        assert!(mean > 2.5, "{medians:?}");
        // One frame that something else held up counts for nothing.
        let mut held_up = vec![1.0; 25];
        held_up[11] = 900.0;
        assert!(plan.sum_up(&held_up).iter().all(|&m| m < 2.0));
    }
}
