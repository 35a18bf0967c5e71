//! Where the motion will be when a tree that is asked for now is in use.
//!
//! Key frames are known before they are reached. So a tree may be built for the moment it is used, if somebody guesses
//! when that is. The guess: frames go on by the last step of time, and trees take as many frames as the last ones did that
//! were made by the same strategy. Before one has come, the first build and the pace of the first frames must do.

use crate::tree_builder::BuildStrategy;
use std::time::{Duration, Instant};

/// Frames that say nothing of the pace: the first waits for its tree, others
/// may come before the queue of frames under way is full.
const UNSETTLED: u32 = 2;
/// A later build takes about so much of the first one's time, as it finds its memory ready.
pub(crate) const LATER_BUILD: f64 = 0.4;
/// Key frames that a first tree is built for: within so many, motion is about straight.
const FIRST_USE: f64 = 1.0;
/// A tree made of groups of the last one takes about so much of the time of one from scratch.
const GROUPS: f64 = 0.5;

/// Watches frames go by and trees come; guesses what comes next.
#[derive(Clone, Debug, Default)]
pub(crate) struct LatencyPredictor {
    range: [f64; 2],
    time: f64,
    step: f64,
    /// Frames between asking for a tree and swapping to it, by agreement.
    agreed: Option<f64>,
    /// The same as seen, of trees from scratch and of trees of groups.
    seen: [Option<f64>; 2],
    /// How the next tree will be made.
    next: BuildStrategy,
    /// What it is taken for as long as none was seen.
    guess: Option<f64>,
    first_build: Option<Duration>,
    /// Frames from the first one that may evaluate a tree to the one that may adopt it.
    evaluation: f64,
    /// Frames begun, and when the pace began to count.
    frames: u32,
    settled: Option<Instant>,
}

impl LatencyPredictor {
    /// Frames will lie within `range`; `agreed` is the latency if it is fixed.
    pub(crate) fn new(range: [f64; 2], agreed: Option<u32>) -> Self {
        Self {
            range,
            time: f64::NAN,
            agreed: agreed.map(f64::from),
            ..Self::default()
        }
    }

    /// The next frame is at `time`; it begins `now`.
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

    /// The first tree, which a frame waited for, took so long.
    pub(crate) fn first_took(&mut self, build: Duration) {
        self.first_build = Some(build);
    }

    /// Whether the last two frames were at the same time.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.step == 0.0
    }

    /// Whether there is any ground for a guess.
    pub(crate) fn has_ground(&self) -> bool {
        self.latency().or(self.guess).is_some()
    }

    /// A tree made by one strategy came so many frames after it was asked for. That it comes sooner than the ones before is
    /// believed at once, for the first ones had to find their memory; that it comes later, by half.
    pub(crate) fn observe_latency(&mut self, frames: u64, strategy: BuildStrategy) {
        let seen = &mut self.seen[strategy as usize];
        let frames = frames as f64;
        let mean = |before| f64::midpoint(before, frames);
        *seen = Some(seen.map_or(frames, |before| mean(before).min(frames)));
    }

    /// A tree was evaluated, which took `frames` frames.
    pub(crate) fn observe_evaluation(&mut self, frames: u64) {
        self.evaluation = frames as f64;
    }

    /// How the next tree will be made.
    pub(crate) fn next_strategy_is(&mut self, strategy: BuildStrategy) {
        self.next = strategy;
    }

    /// Whether a tree for the moment `new` is to be used from now on, instead of one for `last`: when its moment is the
    /// nearer one, or comes no nearer.
    pub(crate) fn should_adopt(&self, last: f64, new: f64) -> bool {
        let nearer = |left| left <= (last - self.time).abs();
        self.approach(new).is_none_or(nearer)
    }

    /// Returns how far the moment `new` is away, in key frames, if time comes nearer to it.
    pub(crate) fn approach(&self, new: f64) -> Option<f64> {
        let comes_nearer = (new - self.time) * self.step > 0.0;
        comes_nearer.then_some((new - self.time).abs())
    }

    /// Whether a tree for the moment `new` is to be evaluated again: half of the distance is left at which it cost too much, or
    /// time comes no nearer to it.
    pub(crate) fn is_nearer(&self, new: f64, dearer_at: Option<f64>) -> bool {
        match self.approach(new).zip(dearer_at) {
            Some((left, before)) => left <= 0.5 * before,
            None => true,
        }
    }

    /// Whether a tree asked for now would be there before one for the moment `new` is ripe, which came much too early.
    pub(crate) fn newer_tree_due_first(&self, last: f64, new: f64) -> bool {
        let ripe = f64::midpoint(last, new);
        (ripe - self.time) / self.step > self.expected()
    }

    /// The middle of the frames traced with a tree asked for now: the next one
    /// will be asked for when it is swapped in, and take as long.
    pub(crate) fn middle_of_use(&self) -> f64 {
        self.in_use(0.5)
    }

    /// The middles of both halves of that use.
    pub(crate) fn halves_of_use(&self) -> [f64; 2] {
        [0.25, 0.75].map(|share| self.in_use(share))
    }

    /// When that share of those frames has passed.
    fn in_use(&self, share: f64) -> f64 {
        let latency = self.expected();
        self.ahead(latency + share * (latency - 1.0).max(0.0))
    }

    /// The middles of both halves of the time that a first tree is built for, as long as nobody knows how long it will
    /// be used; `None` at the end of the range.
    pub(crate) fn halves_of_first_use(&self) -> Option<[f64; 2]> {
        let left = FIRST_USE.min(self.range[1] - self.time);
        (left > 0.0).then(|| [0.25, 0.75].map(|share| self.time + share * left))
    }

    /// Returns for how many frames a tree that is adopted now is used, rounded up.
    pub(crate) fn frames_of_use(&self) -> u64 {
        self.expected().ceil() as u64
    }

    fn expected(&self) -> f64 {
        let built = self.latency().or(self.guess).unwrap_or(0.0);
        built + self.evaluation
    }

    /// Of the next tree, where any was seen or agreed.
    fn latency(&self) -> Option<f64> {
        let [scratch, groups] = self.seen;
        let seen = match self.next {
            BuildStrategy::Scratch => scratch.or(groups.map(|frames| frames / GROUPS)),
            BuildStrategy::Subtrees => groups.or(scratch.map(|frames| (frames * GROUPS).max(1.0))),
        };
        self.agreed.or(seen)
    }

    /// The time so many frames from now.
    fn ahead(&self, frames: f64) -> f64 {
        let [first, last] = self.range;
        let time = self.time + self.step * frames;
        // A frame outside the range is its own best guess.
        time.clamp(first.min(self.time), last.max(self.time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watching(range: [f64; 2], agreed: Option<u32>, times: &[f64]) -> LatencyPredictor {
        let mut f = LatencyPredictor::new(range, agreed);
        times.iter().for_each(|&t| f.frame(t, Instant::now()));
        f
    }

    #[test]
    fn a_steady_motion_is_continued_to_the_middle_of_the_trees_use() {
        let mut f = watching([0.0, 100.0], None, &[0.0, 0.5, 1.0]);
        assert_eq!(f.middle_of_use(), 1.0);
        f.observe_latency(4, BuildStrategy::Scratch);
        // Swapped in 4 frames on, used for frames 4 to 7 from now.
        assert_eq!(f.middle_of_use(), 1.0 + 5.5 * 0.5);
        assert_eq!(f.halves_of_use(), [1.0 + 4.75 * 0.5, 1.0 + 6.25 * 0.5]);
        // The mean of both is 6: used for frames 6 to 11.
        f.observe_latency(8, BuildStrategy::Scratch);
        assert_eq!(f.middle_of_use(), 1.0 + 8.5 * 0.5);
    }

    #[test]
    fn trees_of_groups_and_trees_from_scratch_are_told_apart() {
        let mut f = watching([0.0, 1000.0], None, &[0.0, 1.0]);
        f.observe_latency(40, BuildStrategy::Scratch);
        assert_eq!(f.middle_of_use(), 1.0 + 40.0 + 19.5);
        // Nobody saw one of groups yet.
        f.next_strategy_is(BuildStrategy::Subtrees);
        assert_eq!(f.middle_of_use(), 1.0 + 20.0 + 9.5);
        f.observe_latency(10, BuildStrategy::Subtrees);
        assert_eq!(f.middle_of_use(), 1.0 + 10.0 + 4.5);
        f.observe_latency(20, BuildStrategy::Subtrees);
        assert_eq!(f.middle_of_use(), 1.0 + 15.0 + 7.0);
        f.observe_latency(8, BuildStrategy::Subtrees);
        assert_eq!(f.middle_of_use(), 1.0 + 8.0 + 3.5);
        f.next_strategy_is(BuildStrategy::Scratch);
        assert_eq!(f.middle_of_use(), 1.0 + 40.0 + 19.5);
    }

    #[test]
    fn a_tree_is_ripe_when_its_moment_is_nearer_than_the_last_ones() {
        for (times, last, new, ripe) in [
            ([1.0, 2.0], 1.5, 4.0, false),
            ([2.0, 3.0], 1.5, 4.0, true),
            // Nothing moves; time runs away from it, or ran past it.
            ([2.0, 2.0], 1.5, 4.0, true),
            ([2.0, 1.9], 1.5, 4.0, true),
            ([2.0, 5.0], 4.9, 4.0, true),
            // Backwards.
            ([9.0, 8.0], 8.5, 6.0, false),
            ([8.0, 7.0], 8.5, 6.0, true),
        ] {
            let f = watching([0.0, 100.0], None, &times);
            assert_eq!(f.should_adopt(last, new), ripe, "{times:?}");
        }
    }

    #[test]
    fn a_tree_that_comes_long_before_its_moment_gives_way_to_one_that_comes_sooner() {
        let at = |times: &[f64], latency| {
            let mut f = watching([0.0, 100.0], None, times);
            f.observe_latency(latency, BuildStrategy::Scratch);
            f.newer_tree_due_first(1.0, 41.0)
        };
        // Ripe at 21: in 19 frames, or in 38.
        assert!(at(&[1.0, 2.0], 18));
        assert!(!at(&[1.0, 2.0], 19));
        assert!(at(&[1.5, 2.0], 37));
        assert!(!at(&[1.5, 2.0], 38));
        // Backwards, from 40 to 21.
        assert!(at(&[41.0, 40.0], 18));
        assert!(!at(&[41.0, 40.0], 19));
    }

    #[test]
    fn a_first_tree_is_built_for_a_key_frame_or_what_is_left() {
        let at = |time| watching([0.0, 9.0], None, &[time]).halves_of_first_use();
        assert_eq!(at(2.0), Some([2.25, 2.75]));
        let left = [0.25, 0.75].map(|share| 8.8 + share * (9.0 - 8.8));
        assert_eq!(at(8.8), Some(left));
        assert_eq!((at(9.0), at(9.5)), (None, None));
    }

    #[test]
    fn before_a_tree_has_come_the_first_build_and_the_pace_tell() {
        let ms = Duration::from_millis;
        let start = Instant::now();
        let mut f = LatencyPredictor::new([0.0, 1000.0], None);
        f.frame(0.0, start);
        f.first_took(ms(200));
        // Neither the wait for the first tree nor a frame handed in at once is the pace.
        f.frame(1.0, start + ms(900));
        f.frame(2.0, start + ms(901));
        assert!(!f.has_ground());
        assert_eq!(f.middle_of_use(), 2.0);
        // A frame in 10 ms, two fifths of the first build: in use 8 to 15 frames on.
        f.frame(3.0, start + ms(911));
        assert!(f.has_ground());
        assert!((f.middle_of_use() - (3.0 + 11.5)).abs() < 1e-9);
        // The mean of frames of 10 and 22 ms: 5 frames.
        f.frame(4.0, start + ms(933));
        assert!((f.middle_of_use() - (4.0 + 7.0)).abs() < 1e-9);
        // What was seen takes its place.
        f.observe_latency(3, BuildStrategy::Scratch);
        f.frame(5.0, start + ms(940));
        assert_eq!(f.middle_of_use(), 5.0 + 4.0);
        // A tree takes a frame at least, however fast it is built.
        let mut f = LatencyPredictor::new([0.0, 1000.0], None);
        f.first_took(Duration::ZERO);
        (0..4).for_each(|i| f.frame(f64::from(i), start));
        assert_eq!(f.middle_of_use(), 4.0);
    }

    #[test]
    fn an_agreed_latency_is_not_learned_and_no_guess_leaves_the_range_but_for_a_frame_outside_it() {
        for (range, agreed, times, middle) in [
            ([0.0, 100.0], 3, &[0.0, 1.0][..], 5.0),
            ([0.0, 100.0], 0, &[0.0, 1.0], 1.0),
            ([2.0, 9.0], 10, &[3.0, 4.0], 9.0),
            ([2.0, 9.0], 10, &[4.0, 3.0], 2.0),
            ([2.0, 9.0], 10, &[10.0, 11.0], 11.0),
            ([2.0, 9.0], 10, &[3.0], 3.0),
        ] {
            let mut f = watching(range, Some(agreed), times);
            assert!(f.has_ground());
            f.observe_latency(50, BuildStrategy::Scratch);
            assert_eq!(f.middle_of_use(), middle, "{times:?}");
        }
        let back = watching([2.0, 9.0], Some(10), &[4.0, 3.0]);
        assert_eq!(back.halves_of_use(), [2.0; 2]);
    }
}
