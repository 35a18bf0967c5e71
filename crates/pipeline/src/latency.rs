//! Predicts when a tree that is requested now will be used: see `docs/design/trees.md`.

use crate::tree_builder::BuildStrategy;
use std::time::{Duration, Instant};

/// Number of initial frames that do not count for the frame rate. The first frame waits for its tree. The next one may
/// begin early, because the queue of frames in flight is not full yet.
const UNSETTLED: u32 = 2;
/// Duration of a later build relative to the first, because later builds reuse allocated memory.
pub(crate) const LATER_BUILD: f64 = 0.4;
/// Length of the interval that the first tree is built for, in key frames. Within one key frame, motion is nearly
/// straight.
const FIRST_USE: f64 = 1.0;
/// Duration of a build from subtrees relative to a build from scratch.
const SUBTREES: f64 = 0.5;

/// Observes frames and builds, and predicts when the next tree will be used.
#[derive(Clone, Debug, Default)]
pub(crate) struct LatencyPredictor {
    /// First and last time of the run, in key frames.
    range: [f64; 2],
    /// Time of the last frame; NaN before the first.
    time: f64,
    /// Difference between the times of the last two frames.
    step: f64,
    /// Latency in frames from request to adoption, if the policy fixes it.
    fixed: Option<f64>,
    /// Observed latency in frames, for each strategy: from scratch, from subtrees.
    seen: [Option<f64>; 2],
    /// Strategy of the next build.
    next: BuildStrategy,
    /// Estimated latency in frames, used until one is observed.
    guess: Option<f64>,
    first_build: Option<Duration>,
    /// Number of frames from the evaluation of a tree to the earliest frame that can adopt it.
    evaluation: f64,
    /// Number of frames begun.
    frames: u32,
    /// Time at which the measurement of the frame rate began.
    settled: Option<Instant>,
}

impl LatencyPredictor {
    /// Creates a predictor for times within `range`. `fixed` is the latency in frames, if the policy fixes it.
    pub(crate) fn new(range: [f64; 2], fixed: Option<u32>) -> Self {
        Self {
            range,
            time: f64::NAN,
            fixed: fixed.map(f64::from),
            ..Self::default()
        }
    }

    /// Records that a frame at `time` begins `now`.
    pub(crate) fn frame(&mut self, time: f64, now: Instant) {
        let since = time - self.time;
        self.step = if since.is_nan() { 0.0 } else { since };
        self.time = time;
        let counted = self.frames.saturating_sub(UNSETTLED);
        self.frames = self.frames.saturating_add(1);
        let Some(settled) = self.settled else {
            self.settled = (self.frames > UNSETTLED).then_some(now);
            return;
        };
        if let Some(build) = self.first_build {
            let elapsed = now.saturating_duration_since(settled).as_secs_f64();
            let pace = (elapsed / f64::from(counted)).max(1e-6);
            self.guess = Some((LATER_BUILD * build.as_secs_f64() / pace).max(1.0));
        }
    }

    /// Records the duration of the first tree's build.
    pub(crate) fn observe_first_build(&mut self, build: Duration) {
        self.first_build = Some(build);
    }

    /// Returns whether the last two frames had the same time. Returns `true` before the second frame.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.step == 0.0
    }

    /// Returns whether the latency is fixed, was observed or can be estimated.
    pub(crate) fn has_estimate(&self) -> bool {
        self.latency().or(self.guess).is_some()
    }

    /// Records that a tree arrived `frames` frames after its request. A latency below the previous value replaces it,
    /// because allocations slow down early builds. A higher latency is averaged with the previous value.
    pub(crate) fn observe_latency(&mut self, frames: u64, strategy: BuildStrategy) {
        let seen = &mut self.seen[strategy as usize];
        let frames = frames as f64;
        let mean = |before| f64::midpoint(before, frames);
        *seen = Some(seen.map_or(frames, |before| mean(before).min(frames)));
    }

    /// Records that the evaluation of a tree took `frames` frames.
    pub(crate) fn observe_evaluation(&mut self, frames: u64) {
        self.evaluation = frames as f64;
    }

    /// Sets the strategy of the next build.
    pub(crate) fn next_strategy_is(&mut self, strategy: BuildStrategy) {
        self.next = strategy;
    }

    /// Returns whether the last frame's time is at least as near to `new` as to `current`. These are the target times
    /// of a finished tree and of the current tree. Also returns `true` if frame times do not approach `new`.
    pub(crate) fn is_new_target_nearer(&self, current: f64, new: f64) -> bool {
        let nearer = |left| left <= (current - self.time).abs();
        self.approach(new).is_none_or(nearer)
    }

    /// Returns the distance in key frames to the time `new`, or `None` if time does not approach it.
    pub(crate) fn approach(&self, new: f64) -> Option<f64> {
        let comes_nearer = (new - self.time) * self.step > 0.0;
        comes_nearer.then_some((new - self.time).abs())
    }

    /// Returns whether a tree with target time `new` should be evaluated. `costlier_distance` is the distance at which
    /// it was last found to cost too much, if it was evaluated before. It is evaluated again once the distance has
    /// halved, or if time does not approach `new`.
    pub(crate) fn should_evaluate(&self, new: f64, costlier_distance: Option<f64>) -> bool {
        match self.approach(new).zip(costlier_distance) {
            Some((left, before)) => left <= 0.5 * before,
            None => true,
        }
    }

    /// Returns whether a tree requested now would arrive before the midpoint of two target times: `current`, that of the
    /// current tree, and `new`, that of a finished tree. From the midpoint on, the finished tree is the nearer one.
    pub(crate) fn newer_tree_arrives_first(&self, current: f64, new: f64) -> bool {
        let midpoint = f64::midpoint(current, new);
        (midpoint - self.time) / self.step > self.expected_latency()
    }

    /// Returns the middle of the time in which a tree requested now is used. Assumes that the next tree is requested
    /// when this one is adopted, and that its build takes as long.
    pub(crate) fn target_time(&self) -> f64 {
        self.in_use(0.5)
    }

    /// Returns the times at one quarter and at three quarters of the time in which a tree requested now is used.
    pub(crate) fn swept_times(&self) -> [f64; 2] {
        [0.25, 0.75].map(|share| self.in_use(share))
    }

    /// Returns the time at which a tree requested now has been used for `share` of its frames.
    fn in_use(&self, share: f64) -> f64 {
        let latency = self.expected_latency();
        self.ahead(latency + share * (latency - 1.0).max(0.0))
    }

    /// Returns the times at one quarter and at three quarters of the interval that the first tree is built for. The
    /// length of the interval is fixed, because the time of use is unknown. Returns `None` at the end of the range.
    pub(crate) fn swept_times_of_first_tree(&self) -> Option<[f64; 2]> {
        let left = FIRST_USE.min(self.range[1] - self.time);
        (left > 0.0).then(|| [0.25, 0.75].map(|share| self.time + share * left))
    }

    /// Returns the expected number of frames from a request to the adoption, including the evaluation. Without an
    /// estimate, the build counts as 0 frames.
    fn expected_latency(&self) -> f64 {
        let built = self.latency().or(self.guess).unwrap_or(0.0);
        built + self.evaluation
    }

    /// Returns the latency of the next tree in frames, if it is fixed or was observed.
    fn latency(&self) -> Option<f64> {
        let [scratch, subtrees] = self.seen;
        let seen = match self.next {
            BuildStrategy::Scratch => scratch.or(subtrees.map(|frames| frames / SUBTREES)),
            BuildStrategy::Subtrees => {
                subtrees.or(scratch.map(|frames| (frames * SUBTREES).max(1.0)))
            }
        };
        self.fixed.or(seen)
    }

    /// Returns the time `frames` frames from now, limited to the range.
    fn ahead(&self, frames: f64) -> f64 {
        let [first, last] = self.range;
        let time = self.time + self.step * frames;
        // A frame outside the range extends the range to its own time.
        time.clamp(first.min(self.time), last.max(self.time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watching(range: [f64; 2], fixed: Option<u32>, times: &[f64]) -> LatencyPredictor {
        let mut f = LatencyPredictor::new(range, fixed);
        times.iter().for_each(|&t| f.frame(t, Instant::now()));
        f
    }

    #[test]
    fn latency_is_tracked_per_strategy() {
        let mut f = watching([0.0, 1000.0], None, &[0.0, 0.5]);
        let at = |frames: f64| 0.5 + 0.5 * frames;
        f.observe_latency(40, BuildStrategy::Scratch);
        // The tree is adopted after 40 frames and used for frames 40 to 79 from now.
        assert_eq!(f.target_time(), at(40.0 + 19.5));
        assert_eq!(f.swept_times(), [at(40.0 + 9.75), at(40.0 + 29.25)]);
        // No build from subtrees was observed, so it is assumed to take half as long.
        f.next_strategy_is(BuildStrategy::Subtrees);
        assert_eq!(f.target_time(), at(20.0 + 9.5));
        f.observe_latency(10, BuildStrategy::Subtrees);
        assert_eq!(f.target_time(), at(10.0 + 4.5));
        f.observe_latency(20, BuildStrategy::Subtrees);
        assert_eq!(f.target_time(), at(15.0 + 7.0));
        f.observe_latency(8, BuildStrategy::Subtrees);
        assert_eq!(f.target_time(), at(8.0 + 3.5));
        f.next_strategy_is(BuildStrategy::Scratch);
        assert_eq!(f.target_time(), at(40.0 + 19.5));
    }

    #[test]
    fn adopts_the_tree_nearest_in_time() {
        for (times, current, new, expected) in [
            ([1.0, 2.0], 1.5, 4.0, false),
            ([2.0, 3.0], 1.5, 4.0, true),
            // Without motion; time moves away from `new`; time has passed `new`.
            ([2.0, 2.0], 1.5, 4.0, true),
            ([2.0, 1.9], 1.5, 4.0, true),
            ([2.0, 5.0], 4.9, 4.0, true),
            // Time runs backwards.
            ([9.0, 8.0], 8.5, 6.0, false),
            ([8.0, 7.0], 8.5, 6.0, true),
        ] {
            let f = watching([0.0, 100.0], None, &times);
            assert_eq!(f.is_new_target_nearer(current, new), expected, "{times:?}");
        }
    }

    #[test]
    fn newer_tree_may_be_due_first() {
        let at = |times: &[f64], latency| {
            let mut f = watching([0.0, 100.0], None, times);
            f.observe_latency(latency, BuildStrategy::Scratch);
            f.newer_tree_arrives_first(1.0, 41.0)
        };
        // The midpoint of the target times is 21. From time 2, that is 19 frames with steps of 1, and 38 with steps of
        // 0.5.
        assert!(at(&[1.0, 2.0], 18));
        assert!(!at(&[1.0, 2.0], 19));
        assert!(at(&[1.5, 2.0], 37));
        assert!(!at(&[1.5, 2.0], 38));
        // Time runs backwards, from 40 to 21.
        assert!(at(&[41.0, 40.0], 18));
        assert!(!at(&[41.0, 40.0], 19));
    }

    #[test]
    fn first_use_is_clamped_to_range() {
        let at = |time| watching([0.0, 9.0], None, &[time]).swept_times_of_first_tree();
        assert_eq!(at(2.0), Some([2.25, 2.75]));
        let left = [0.25, 0.75].map(|share| 8.8 + share * (9.0 - 8.8));
        assert_eq!(at(8.8), Some(left));
        assert_eq!((at(9.0), at(9.5)), (None, None));
    }

    #[test]
    fn initial_estimate_uses_first_build_time() {
        let ms = Duration::from_millis;
        let start = Instant::now();
        let mut f = LatencyPredictor::new([0.0, 1000.0], None);
        f.frame(0.0, start);
        f.observe_first_build(ms(200));
        // Neither the wait for the first tree nor a frame submitted immediately counts for the frame rate.
        f.frame(1.0, start + ms(900));
        f.frame(2.0, start + ms(901));
        assert!(!f.has_estimate());
        assert_eq!(f.target_time(), 2.0);
        // A frame takes 10 ms and the next build 80 ms: the tree is used for frames 8 to 15.
        f.frame(3.0, start + ms(911));
        assert!(f.has_estimate());
        assert!((f.target_time() - (3.0 + 11.5)).abs() < 1e-9);
        // Frames of 10 and 22 ms take 16 ms in the mean, so the build takes 5 frames.
        f.frame(4.0, start + ms(933));
        assert!((f.target_time() - (4.0 + 7.0)).abs() < 1e-9);
        // An observed latency replaces the estimate.
        f.observe_latency(3, BuildStrategy::Scratch);
        f.frame(5.0, start + ms(940));
        assert_eq!(f.target_time(), 5.0 + 4.0);
        // A tree takes at least one frame, however fast it is built.
        let mut f = LatencyPredictor::new([0.0, 1000.0], None);
        f.observe_first_build(Duration::ZERO);
        (0..4).for_each(|i| f.frame(f64::from(i), start));
        assert_eq!(f.target_time(), 4.0);
    }

    #[test]
    fn fixed_latency_and_range_are_respected() {
        for (range, fixed, times, middle) in [
            ([0.0, 100.0], 3, &[0.0, 1.0][..], 5.0),
            ([0.0, 100.0], 0, &[0.0, 1.0], 1.0),
            ([2.0, 9.0], 10, &[3.0, 4.0], 9.0),
            ([2.0, 9.0], 10, &[4.0, 3.0], 2.0),
            ([2.0, 9.0], 10, &[10.0, 11.0], 11.0),
            ([2.0, 9.0], 10, &[3.0], 3.0),
        ] {
            let mut f = watching(range, Some(fixed), times);
            assert!(f.has_estimate());
            f.observe_latency(50, BuildStrategy::Scratch);
            assert_eq!(f.target_time(), middle, "{times:?}");
        }
        let back = watching([2.0, 9.0], Some(10), &[4.0, 3.0]);
        assert_eq!(back.swept_times(), [2.0; 2]);
    }
}
