//! Pauses requests after trees were rejected: see `docs/design/trees.md`.

/// Number of consecutive rejections after which pauses stop growing. Builds then run for 1/32 of the time.
const MAX_REJECTIONS: u32 = 6;
/// An adopted tree ends the pauses if its cost is at most this fraction of the replaced tree's.
const GOOD_RATIO: f64 = 0.9;
/// The pauses end if the current tree's cost exceeds its previous maximum by more than this factor.
const COST_RISE: f64 = 1.1;

/// Counts rejections and sets the pause.
#[derive(Debug, Default)]
pub(super) struct RequestPause {
    /// Number of rejections since the pauses last ended, at most `MAX_REJECTIONS - 1`. An adoption whose cost ratio
    /// exceeds [`GOOD_RATIO`] counts as a rejection.
    rejections: u32,
    /// Frame from which on trees may be requested.
    until: u64,
    /// Largest cost of the current tree since the last adoption whose cost ratio was at most [`GOOD_RATIO`].
    highest_cost: f64,
}

impl RequestPause {
    /// Records that frame `now` rejects a tree. Its request, build and evaluation took `frames` frames.
    pub(super) fn rejected(&mut self, now: u64, frames: u64) {
        let pause = (1 << self.rejections) - 1;
        self.rejections = (self.rejections + 1).min(MAX_REJECTIONS - 1);
        self.until = now + pause * frames;
    }

    /// Records that frame `now` adopts a tree. Its request, build and evaluation took `frames` frames. Its cost is
    /// `cost_ratio` times the replaced tree's at the same positions.
    pub(super) fn adopted(&mut self, now: u64, frames: u64, cost_ratio: f64) {
        if cost_ratio > GOOD_RATIO {
            self.rejected(now, frames);
        } else {
            *self = Self::default();
        }
    }

    /// Records the cost of the current tree in a frame.
    pub(super) fn observe_cost(&mut self, cost: f64) {
        if cost > COST_RISE * self.highest_cost && self.highest_cost > 0.0 {
            (self.rejections, self.until) = (0, 0);
        }
        self.highest_cost = self.highest_cost.max(cost);
    }

    /// Returns whether no tree may be requested in frame `now`.
    pub(super) fn covers(&self, now: u64) -> bool {
        now < self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of frames until the next request, after each of `count` rejections.
    fn pauses(pause: &mut RequestPause, count: usize) -> Vec<u64> {
        let frames = |_| {
            pause.rejected(100, 10);
            (100..).find(|&now| !pause.covers(now)).unwrap() - 100
        };
        (0..count).map(frames).collect()
    }

    #[test]
    fn pauses_double_until_adoption() {
        let mut pause = RequestPause::default();
        let all = [0, 10, 30, 70, 150, 310, 310];
        assert_eq!(pauses(&mut pause, 7), all);
        pause.adopted(100, 10, 0.9);
        assert_eq!(pauses(&mut pause, 2), all[..2]);
        for (cost, is_over) in [(2.0, false), (1.0, false), (2.1, false), (2.4, true)] {
            pause.observe_cost(cost);
            assert_eq!(!pause.covers(101), is_over, "{cost}");
        }
        assert_eq!(pauses(&mut pause, 2), all[..2]);
    }

    #[test]
    fn small_savings_count_as_rejection() {
        let mut pause = RequestPause::default();
        pauses(&mut pause, 2);
        pause.adopted(100, 10, 0.91);
        assert!(pause.covers(129) && !pause.covers(130));
    }
}
