//! Maps a device's times to the host's clock.
//!
//! The two clocks have different zeros. But no part of a submission ran before the host submitted it, or after the host
//! saw that it was finished. So each submission bounds the offset between the clocks from both sides. All submissions
//! together bound the offset to an interval, whose length is the minimum latency of submission plus the minimum latency
//! of notification. The middle of the interval is used, so the error is at most half its length.
//!
//! Clocks also drift, by some microseconds per second. If bounds contradict each other, the run is split in two, and
//! each half has its own offset.
//!
//! Work without a start time on the device's clock is assumed to end when the host saw that it was finished. This is
//! the latest possible time. Submissions run one after another, so work that would overlap the next submission is moved
//! before it.

use crate::frame::TimedSubmission;
use std::time::Instant;

/// Interval on the host's clock, in milliseconds since some origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Start.
    pub begin_ms: f64,
    /// End.
    pub end_ms: f64,
}

/// Returns the intervals from the first stage's start to the last stage's end of each submission, in milliseconds since
/// `origin` on the host's clock. `submissions` must be in submission order. The intervals do not overlap.
pub fn place_on_host(origin: Instant, submissions: &[TimedSubmission]) -> Vec<Span> {
    let bounds: Vec<OffsetBounds> = submissions.iter().map(|s| bounds(origin, s)).collect();
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

/// Minimum and maximum of `host - device`, in milliseconds.
type OffsetBounds = [f64; 2];

const UNBOUNDED: OffsetBounds = [f64::NEG_INFINITY, f64::INFINITY];

/// Returns the bounds from one submission: infinite without a start time on the device's clock.
fn bounds(origin: Instant, submission: &TimedSubmission) -> OffsetBounds {
    let times = submission.times;
    times.begun_ms.map_or(UNBOUNDED, |begun| {
        let least = host_ms(origin, submission.handed_in) - begun;
        let most = host_ms(origin, submission.seen) - (begun + times.device_ms);
        [least, most]
    })
}

/// Computes the offsets: one for the whole run if its bounds allow, otherwise separately for each half.
fn find_offsets(bounds: &[OffsetBounds], offsets: &mut [f64]) {
    let both = |a: OffsetBounds, b: &OffsetBounds| [a[0].max(b[0]), a[1].min(b[1])];
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

/// Returns milliseconds since `origin`; negative before it.
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

    fn submission(
        origin: Instant,
        [handed_in, seen]: [f64; 2],
        times: StageTimes,
    ) -> TimedSubmission {
        let at = |ms: f64| origin + Duration::from_secs_f64(ms * 1e-3);
        TimedSubmission {
            handed_in: at(handed_in),
            seen: at(seen),
            times,
        }
    }

    /// Simulates frames on a device whose clock has the offset `zero` and drifts by `drift`. Also returns the true
    /// start times.
    fn run(
        zero: f64,
        drift: f64,
        frames: &[[f64; 4]],
    ) -> (Instant, Vec<TimedSubmission>, Vec<f64>) {
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
    fn missing_clock_falls_back_to_host() {
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
    fn follows_clock_drift() {
        // 1000 frames of 10 ms with latencies of 0.02 ms. A drift of 50 ppm adds up to half a millisecond.
        let (origin, all, truth) = run(7e6, 5e-5, &vec![[0.0, 0.02, 10.0, 0.02]; 1000]);
        let spans = place_on_host(origin, &all);
        for (span, begun) in spans.iter().zip(&truth) {
            assert!((span.begin_ms - begun).abs() < 0.05, "{span:?} {begun}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        /// Placed work differs from its true time by at most half of the two minimum latencies, for any clock offset.
        #[test]
        fn placement_error_is_bounded_by_latency(
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
