//! Where a device's work lies on the host's clock.
//!
//! The two clocks have different zeros. But nothing of a submission ran before the host handed it in, nor after the host saw
//! its end. So each submission bounds the offset between the clocks from both sides. All of them together bound it to the
//! least latency of handing in plus the least of seeing. The middle is taken, so the error is at most half of that.
//!
//! Clocks also drift (some microseconds a second): where bounds contradict each other, the run is cut in two, each with an
//! offset of its own.
//!
//! Work without a begin on the device's clock is taken to end when it was seen to: the latest it can be. Submissions run one
//! after the other, so whatever would reach into the next is moved before it.

use crate::frame::Submission;
use std::time::Instant;

/// A stretch of the host's clock, in milliseconds from some origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Its begin.
    pub begin_ms: f64,
    /// Its end.
    pub end_ms: f64,
}

/// The part of a submission between its first stage's begin and the last one's end, in milliseconds since `origin` on
/// the host's clock; one for each of `submissions`, which must be in the order they were handed in. No two overlap.
pub fn place_on_host(origin: Instant, submissions: &[Submission]) -> Vec<Span> {
    let bounds: Vec<Bounds> = submissions.iter().map(|s| bounds(origin, s)).collect();
    let mut offsets = vec![0.0; bounds.len()];
    find_offsets(&bounds, &mut offsets);
    let mut spans: Vec<Span> = submissions
        .iter()
        .zip(&offsets)
        .map(|(submission, offset)| {
            let times = submission.times;
            let end_ms = match times.begun_ms {
                Some(begun) => begun + times.device_ms + offset,
                None => host_ms(origin, submission.seen),
            };
            Span {
                begin_ms: end_ms - times.device_ms,
                end_ms,
            }
        })
        .collect();
    let mut next = f64::INFINITY;
    for span in spans.iter_mut().rev() {
        let late = (span.end_ms - next).max(0.0);
        span.end_ms -= late;
        span.begin_ms -= late;
        next = span.begin_ms;
    }
    spans
}

/// The least and the most that `host - device` may be, in milliseconds.
type Bounds = [f64; 2];

const UNBOUNDED: Bounds = [f64::NEG_INFINITY, f64::INFINITY];

/// What one submission says: nothing without a begin on the device's clock.
fn bounds(origin: Instant, submission: &Submission) -> Bounds {
    let times = submission.times;
    times.begun_ms.map_or(UNBOUNDED, |begun| {
        let least = host_ms(origin, submission.handed_in) - begun;
        let most = host_ms(origin, submission.seen) - (begun + times.device_ms);
        [least, most]
    })
}

/// One offset for as long a stretch as its bounds allow.
fn find_offsets(bounds: &[Bounds], offsets: &mut [f64]) {
    let both = |a: Bounds, b: &Bounds| [a[0].max(b[0]), a[1].min(b[1])];
    let [least, most] = bounds.iter().fold(UNBOUNDED, both);
    if least <= most || bounds.len() < 2 {
        let middle = f64::midpoint(least, most);
        offsets.fill(if middle.is_finite() { middle } else { 0.0 });
        return;
    }
    let half = bounds.len() / 2;
    find_offsets(&bounds[..half], &mut offsets[..half]);
    find_offsets(&bounds[half..], &mut offsets[half..]);
}

/// Milliseconds since `origin`; negative before it.
fn host_ms(origin: Instant, at: Instant) -> f64 {
    let after = at.saturating_duration_since(origin).as_secs_f64();
    let before = origin.saturating_duration_since(at).as_secs_f64();
    (after - before) * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::StageTimes;
    use proptest::prelude::*;
    use std::time::Duration;

    fn submission(origin: Instant, [handed_in, seen]: [f64; 2], times: StageTimes) -> Submission {
        let at = |ms: f64| origin + Duration::from_secs_f64(ms * 1e-3);
        Submission {
            handed_in: at(handed_in),
            seen: at(seen),
            times,
        }
    }

    /// Frames of a device whose clock stands `zero` from the host's and drifts by `drift`;
    /// with each, where it truly lies.
    fn run(zero: f64, drift: f64, frames: &[[f64; 4]]) -> (Instant, Vec<Submission>, Vec<f64>) {
        let origin = Instant::now();
        let mut free = 0.0;
        let (mut all, mut truth) = (Vec::new(), Vec::new());
        for [idle, to_device, work, to_host] in frames {
            let handed_in = free + idle;
            let begun = handed_in + to_device;
            free = begun + work;
            let times = StageTimes {
                begun_ms: Some(zero + begun * (1.0 + drift)),
                device_ms: *work,
                ..StageTimes::default()
            };
            all.push(submission(origin, [handed_in, free + to_host], times));
            truth.push(begun);
        }
        (origin, all, truth)
    }

    #[test]
    fn without_a_device_clock_work_ends_when_seen_but_before_the_next() {
        let origin = Instant::now();
        let times = |ms| StageTimes {
            device_ms: ms,
            ..StageTimes::default()
        };
        let all = [
            submission(origin, [0.0, 4.0], times(2.0)),
            submission(origin, [4.0, 12.0], times(3.0)),
            submission(origin, [5.0, 12.5], times(3.0)),
        ];
        let spans = place_on_host(origin, &all);
        let rounded: Vec<_> = spans
            .iter()
            .map(|s| [s.begin_ms, s.end_ms].map(|x| (x * 1e3).round() / 1e3))
            .collect();
        assert_eq!(rounded, [[2.0, 4.0], [6.5, 9.5], [9.5, 12.5]]);
    }

    #[test]
    fn a_clock_that_drifts_is_followed() {
        // 1000 frames of 10 ms, 50 ppm: half a millisecond off at the end, latencies of 0.02 ms.
        let (origin, all, truth) = run(7e6, 5e-5, &vec![[0.0, 0.02, 10.0, 0.02]; 1000]);
        let spans = place_on_host(origin, &all);
        for (span, begun) in spans.iter().zip(&truth) {
            assert!((span.begin_ms - begun).abs() < 0.05, "{span:?} {begun}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        /// Work lies where it was, within half of the two least latencies, whatever the clock's zero.
        #[test]
        fn placed_work_is_off_by_half_the_least_latencies_at_most(
            zero in -1e6_f64..1e6,
            frames in proptest::collection::vec([0.0_f64..5.0, 0.01..2.0, 0.1..9.0, 0.01..2.0], 0..60),
        ) {
            let (origin, all, truth) = run(zero, 0.0, &frames);
            let spans = place_on_host(origin, &all);
            let least = |i: usize| frames.iter().map(|f| f[i]).fold(f64::INFINITY, f64::min);
            let allowed = 0.5 * (least(1) + least(3)) + 1e-5;
            for (span, begun) in spans.iter().zip(&truth) {
                prop_assert!((span.begin_ms - begun).abs() <= allowed, "{:?} {} {}", span, begun, allowed);
            }
            for pair in spans.windows(2) {
                prop_assert!(pair[0].end_ms <= pair[1].begin_ms + 1e-9);
            }
        }
    }
}
