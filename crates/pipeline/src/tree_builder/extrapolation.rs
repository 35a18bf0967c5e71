//! Decides whether motion may be extrapolated beyond the last two observed frames, `c` and `d`. The two frames observed
//! before, `a` and `b`, are extrapolated to the time of `c`. The result must be closer to `c` than `b` is.

use crate::motion::distance;
use geom::Point;

/// Maximum number of vertices that are compared, sampled evenly.
const VERTICES: usize = 1024;

/// Compares extrapolated positions with the positions that arrived.
#[derive(Debug)]
pub(super) struct ExtrapolationMonitor {
    /// Sampled vertices of the last two observed frames, and the times of these frames.
    seen: [Vec<Point>; 2],
    times: [f64; 2],
    is_trusted: bool,
}

impl Default for ExtrapolationMonitor {
    fn default() -> Self {
        Self {
            seen: Default::default(),
            times: [0.0; 2],
            is_trusted: true,
        }
    }
}

impl ExtrapolationMonitor {
    /// Records the vertices of the last two observed frames, and the times of these frames. Returns whether the motion
    /// between them may be extrapolated.
    pub(super) fn observe(&mut self, frames: [&[Point]; 2], times: [f64; 2]) -> bool {
        let step = frames[0].len().div_ceil(VERTICES).max(1);
        let some = |frame: &[Point]| frame.iter().step_by(step).copied().collect::<Vec<_>>();
        let now = some(frames[0]);
        if now.len() == self.seen[1].len() {
            let [extrapolated, kept] = self.errors(&now, times[0]);
            // Without motion both are 0.
            self.is_trusted = extrapolated < kept || (extrapolated <= kept && self.is_trusted);
        }
        self.seen = [now, some(frames[1])];
        self.times = times;
        self.is_trusted
    }

    /// Returns two sums of distances from positions `now`: to those extrapolated to `time`, and to those observed last.
    fn errors(&self, now: &[Point], time: f64) -> [f64; 2] {
        let [first, last] = self.times;
        let weight = ((time - first) / (last - first)) as f32;
        let mut errors = [0.0; 2];
        if !weight.is_finite() {
            return errors;
        }
        for ((now, a), b) in now.iter().zip(&self.seen[0]).zip(&self.seen[1]) {
            let extrapolated = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * weight);
            let found = [distance(now, &extrapolated), distance(now, b)];
            if found.iter().all(|error| error.is_finite()) {
                errors[0] += found[0];
                errors[1] += found[1];
            }
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Observes pairs of frames that begin at these times. All vertices are at `place(time)`.
    fn observe(times: &[f64], place: impl Fn(f64) -> f32) -> Vec<bool> {
        let mut monitor = ExtrapolationMonitor::default();
        let at = |time| vec![[place(time), f32::NAN, 0.0], [place(time), 1.0, 0.0]];
        let pair = |&time: &f64| {
            let [a, b] = [time, time + 1.0].map(at);
            monitor.observe([&a, &b], [time, time + 1.0])
        };
        times.iter().map(pair).collect()
    }

    #[test]
    fn extrapolates_until_motion_reverses() {
        assert_eq!(observe(&[0.0, 9.0, 30.0], |t| t as f32), [true; 3]);
        assert_eq!(observe(&[0.0, 9.0], |_| 2.0), [true; 2]);
        // The motion reverses every 15 frames.
        let turns = |t: f64| (15.0 - (t % 30.0 - 15.0).abs()) as f32;
        let times = [0.0, 20.0, 41.0, 62.0, 64.0];
        assert_eq!(observe(&times, turns), [true, false, false, false, true]);
    }

    #[test]
    fn rest_keeps_the_previous_decision() {
        let stops = |t: f64| if t < 12.0 { (12.0 - t) as f32 } else { 10.0 };
        let found = observe(&[0.0, 20.0, 40.0, 60.0], stops);
        assert_eq!(found, [true, false, false, false]);
    }
}
