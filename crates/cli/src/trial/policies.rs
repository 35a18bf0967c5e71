//! How long a frame takes under each update policy, on the host's clock: stretches of the run itself.

use super::Run;
use super::stand::Stand;
use crate::stop::Stop;
use backend::Method;
use pipeline::{Driver, Frame, Update};
use report::Summary;
use std::ops::Range;

/// A policy and the milliseconds of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timed {
    pub(super) update: Update,
    pub(super) ms: f64,
}

/// Stretches of frames that stand for the run: so many, each with frames that warm up before those that are timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    pub(super) stretches: usize,
    pub(super) warm: usize,
    pub(super) timed: usize,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    /// Frames of the run.
    pub(super) frames: usize,
    /// Milliseconds of one.
    pub(super) frame_ms: f64,
    /// Milliseconds of a build.
    pub(super) build_ms: f64,
}

/// Stretches and frames of each, the most telling first.
const PLANS: [(usize, usize); 5] = [(3, 16), (3, 8), (2, 6), (1, 6), (1, 3)];
/// The longest that a stretch warms up, in milliseconds.
const WARM_MS: f64 = 100.0;
/// A policy that is so many times slower than another in its first stretch is given up.
const HOPELESS: f64 = 1.5;

impl Plan {
    /// The most telling that fits into `allowance` milliseconds with so many policies; `None` if none does.
    pub(super) fn within(allowance: f64, policies: usize, guess: Guess) -> Option<Self> {
        let Guess {
            frames,
            frame_ms,
            build_ms,
        } = guess;
        // Two builds, so that trees come from the stretch itself.
        let warm = (2.0 * build_ms).min(WARM_MS) / frame_ms.max(1e-3);
        let plans = PLANS.map(|(stretches, timed)| Self {
            stretches,
            warm: (warm.ceil() as usize).clamp(1, 4 * timed),
            timed,
        });
        plans.into_iter().find(|p| {
            let all = p.stretches * (p.warm + p.timed);
            let one = build_ms + frame_ms + all as f64 * frame_ms;
            // One of them waits for a build each frame, until it is given up.
            let ms = policies as f64 * one + (p.warm + p.timed) as f64 * build_ms;
            all <= frames && ms <= allowance
        })
    }

    /// Frames of each stretch, in the middle of equal parts of the run.
    fn ranges(self, frames: usize) -> impl Iterator<Item = Range<usize>> {
        let long = self.warm + self.timed;
        (0..self.stretches).map(move |i| {
            let middle = (2 * i + 1) * frames / (2 * self.stretches);
            let start = middle
                .saturating_sub(long / 2)
                .min(frames.saturating_sub(long));
            start..(start + long).min(frames)
        })
    }
}

/// Times `candidates`, in order; those that the backend refuses are left out.
///
/// # Errors
/// Nothing could be timed.
pub(super) fn time(
    stand: &mut Stand<'_>,
    method: Method,
    candidates: &[Update],
    (run, plan): (&Run<'_>, Plan),
) -> Result<Vec<Timed>, Stop> {
    let mut all: Vec<Timed> = Vec::new();
    let mut refused = None;
    for &update in candidates {
        let best = all.iter().map(|t| t.ms).fold(f64::INFINITY, f64::min);
        let timed = stand.driver(method, update).and_then(|mut driver| {
            let ms = stretches(&mut driver, run, plan, best)?;
            stand.put_back(driver);
            Ok(Timed { update, ms })
        });
        match timed {
            Ok(timed) => all.push(timed),
            Err(stop) => refused = Some(stop),
        }
    }
    match refused {
        Some(stop) if all.is_empty() => Err(stop),
        _ => Ok(all),
    }
}

/// The mean of the stretches' medians.
fn stretches(driver: &mut Driver, run: &Run<'_>, plan: Plan, best: f64) -> Result<f64, Stop> {
    // The first tree is that of the run's first frame.
    walls(driver, run, &run.frames[..1])?;
    let mut medians = Vec::new();
    for range in plan.ranges(run.frames.len()) {
        let walls = walls(driver, run, &run.frames[range])?;
        let timed = walls.into_iter().skip(plan.warm);
        let median = Summary::of(timed).map_or(f64::INFINITY, |s| s.median);
        medians.push(median);
        if median > HOPELESS * best {
            break;
        }
    }
    Ok(medians.iter().sum::<f64>() / medians.len() as f64)
}

/// What each frame took on the host's clock.
fn walls(driver: &mut Driver, run: &Run<'_>, frames: &[Frame]) -> Result<Vec<f64>, Stop> {
    let mut walls = Vec::with_capacity(frames.len());
    let frames = frames.iter().copied();
    driver.run::<Stop>(frames, run.query, false, |record, _| {
        walls.push(record.wall_ms);
        Ok(())
    })?;
    Ok(walls)
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
    fn a_plan_fits_the_time_and_the_run_or_there_is_none() {
        let all = Plan::within(1500.0, 3, guess(200, 1.0, 5.0)).unwrap();
        assert_eq!((all.stretches, all.timed, all.warm), (3, 16, 10));
        let few = Plan::within(1500.0, 3, guess(48, 50.0, 10.0)).unwrap();
        assert_eq!((few.stretches, few.timed, few.warm), (1, 6, 1));
        assert_eq!(Plan::within(1500.0, 3, guess(48, 500.0, 200.0)), None);
        assert_eq!(Plan::within(1500.0, 3, guess(3, 1.0, 1.0)), None);
    }

    #[test]
    fn stretches_lie_apart_within_the_run() {
        let plan = Plan {
            stretches: 3,
            warm: 2,
            timed: 4,
        };
        let ranges = |frames| plan.ranges(frames).collect::<Vec<_>>();
        assert_eq!(ranges(60), [7..13, 27..33, 47..53]);
        assert_eq!(ranges(18), [0..6, 6..12, 12..18]);
        assert_eq!(ranges(4), [0..4, 0..4, 0..4]);
    }
}
