//! Warms the device up with uncounted frames, because an idle device runs at a low clock and takes long to raise it:
//! see `docs/design/trees.md`.

use super::{Driver, OutputSelection};
use crate::error::PipelineError;
use crate::frame::{Frame, FrameRecord};
use backend::{DeviceKind, FRAMES_IN_FLIGHT, FrameReport, Query};
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Instant;

/// Default seconds of warm-up on a GPU. An H200 that had been idle for ten seconds, while kernels were compiled, was
/// still four times slower than usual after 60 frames (0.25 s).
const DEFAULT_SECONDS: f64 = 0.7;
/// Seconds in each of the two consecutive windows whose medians are compared.
const WINDOW: f64 = 0.1;
/// Minimum number of frames in a window.
const MIN_FRAMES: usize = 3;
/// Largest relative difference between medians that are considered equal.
const TOLERANCE: f64 = 0.03;
/// Maximum additional seconds of warm-up while the medians differ.
const MAX_EXTRA_SECONDS: f64 = 0.5;

/// Result of a warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Warmed {
    /// Duration in seconds, on the host's clock.
    pub seconds: f64,
    /// Number of repeated traces of the first frame that were timed.
    pub frames: usize,
    /// Whether frame times were steady at the end.
    pub steady: bool,
}

/// A warm-up in progress.
#[derive(Debug)]
pub struct WarmUp {
    begun: Instant,
    seconds: f64,
    seen: Vec<TimedTrace>,
}

impl WarmUp {
    /// Begins a warm-up of `asked` seconds, or of the default duration for such a device. Returns `None` if the
    /// duration is 0. CPU backends are never warmed up, software devices only on request.
    #[must_use]
    pub fn begin(asked: Option<f64>, kind: DeviceKind) -> Option<Self> {
        let seconds = match kind {
            DeviceKind::Cpu => 0.0,
            DeviceKind::Gpu => asked.unwrap_or(DEFAULT_SECONDS),
            DeviceKind::Software => asked.unwrap_or(0.0),
        };
        (seconds > 0.0).then(|| Self {
            begun: Instant::now(),
            seconds,
            seen: Vec::new(),
        })
    }

    /// Records the device time of a trace, in milliseconds. Returns whether another trace should follow.
    pub fn goes_on(&mut self, device_ms: f64) -> bool {
        let now = self.begun.elapsed().as_secs_f64();
        self.seen.push(TimedTrace {
            finished: now,
            device_ms,
        });
        now < self.seconds || (now < self.seconds + MAX_EXTRA_SECONDS && !is_steady(&self.seen))
    }

    /// Ends the warm-up.
    #[must_use]
    pub fn end(self) -> Warmed {
        Warmed {
            seconds: self.begun.elapsed().as_secs_f64(),
            frames: self.seen.len(),
            steady: is_steady(&self.seen),
        }
    }
}

/// A trace of a warm-up.
#[derive(Clone, Copy, Debug)]
struct TimedTrace {
    /// Seconds since the start of the warm-up.
    finished: f64,
    device_ms: f64,
}

/// Returns whether the last window's frames took as long as those of the window before. Single frames cannot be
/// compared: the clock rises in steps, so neighbouring frames always agree.
fn is_steady(seen: &[TimedTrace]) -> bool {
    let (earlier, last) = window(seen);
    let (_, before) = window(earlier);
    let [a, b] = [before, last].map(median);
    before.len().min(last.len()) >= MIN_FRAMES && (a - b).abs() <= TOLERANCE * a.max(b)
}

/// Returns the median of the frames' times; of an even number, the larger of the middle two.
fn median(of: &[TimedTrace]) -> f64 {
    let mut times: Vec<f64> = of.iter().map(|trace| trace.device_ms).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Splits off the last frames that fill a window.
fn window(all: &[TimedTrace]) -> (&[TimedTrace], &[TimedTrace]) {
    let end = all.last().map_or(0.0, |trace| trace.finished);
    let is_within = |trace: &&TimedTrace| end - trace.finished < WINDOW;
    let within = all.iter().rev().take_while(is_within);
    let count = within.count().max(MIN_FRAMES).min(all.len());
    all.split_at(all.len() - count)
}

impl Driver {
    /// If the device needs a warm-up, renders the first frame and then warms the device up. `asked` sets the duration
    /// in seconds. Returns the result of the warm-up, if any, and the remaining frames.
    ///
    /// # Errors
    /// Those of [`run`](Self::run).
    pub fn warm_up<'a, E: From<PipelineError>>(
        &mut self,
        asked: Option<f64>,
        frames: &'a [Frame],
        query: Query<'_>,
        mut on_frame: impl FnMut(&FrameRecord) -> Result<(), E>,
    ) -> Result<(Option<Warmed>, &'a [Frame]), E> {
        let progress = WarmUp::begin(asked, self.backend.device().kind);
        // A single frame has no later frames that would gain from a warm-up.
        let Some(mut progress) = progress.filter(|_| frames.len() > 1) else {
            return Ok((None, frames));
        };
        let (first, rest) = frames.split_at(1);
        let selection = OutputSelection::default();
        self.run(first.iter().copied(), query, selection, |record, _| {
            on_frame(record)
        })?;
        // The first frame does not count.
        progress.begun = Instant::now();
        self.repeat_trace(query, |report| progress.goes_on(report.times.device_ms))?;
        Ok((Some(progress.end()), rest))
    }

    /// Traces `query` repeatedly with the last frame's tree and positions, until `again` returns `false` for a trace's
    /// report. Keeps as many traces in flight as the backend allows, so that the device never waits for the host.
    ///
    /// Later frames are not affected: no tree ages, time does not advance and no tree is requested. A build in flight
    /// continues, but none is in flight right after the first frame. With `async`, the builder first builds and drops
    /// trees, so that later builds find their memory allocated: see `TreeBuilder::warm_up`.
    ///
    /// # Errors
    /// Those of the backend.
    ///
    /// # Panics
    /// If no frame was rendered before, or if a frame is in flight.
    fn repeat_trace(
        &mut self,
        query: Query<'_>,
        mut again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        self.warm_up_builder();
        assert!(self.trees.current.is_some(), "a frame comes first");
        assert!(self.pending.is_empty(), "a frame is in flight");
        let mut in_flight = VecDeque::with_capacity(FRAMES_IN_FLIGHT);
        let mut wanted = true;
        loop {
            while wanted && in_flight.len() < FRAMES_IN_FLIGHT {
                self.backend.trace(&[query])?;
                in_flight.push_back(self.backend.submit()?);
            }
            let Some(ticket) = in_flight.pop_front() else {
                return Ok(());
            };
            let report = self.backend.wait(ticket)?;
            wanted = wanted && again(&report);
        }
    }

    /// Warms the builder up, if trees are adopted by cost and no build is in flight.
    fn warm_up_builder(&self) {
        let needs_it = self.options.update.adopts_by_cost() && self.trees.next.is_idle();
        if let Some(pose) = self.recording.pose.filter(|_| needs_it) {
            self.builder.warm_up(pose);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::tests::{Config, drifting, driver, fake::Fake, fake::Log, log_of, query};
    use backend::{Policy, QueryKind};

    /// Runs 20 frames, with `left` uncounted traces after the first.
    fn run(by: Config, mut left: usize) -> (Vec<FrameRecord>, Log) {
        let mut driver = driver(Fake::new(Some(0)), &drifting(30), by).unwrap();
        let query = query(QueryKind::Closest);
        let mut records = Vec::new();
        let frame = |index| Frame {
            index,
            time: index as f64 * 1.4,
        };
        for part in [0..1, 1..20] {
            let done = driver.run(
                part.map(frame),
                query,
                OutputSelection::default(),
                |record, _| {
                    records.push(record.clone());
                    Ok::<(), PipelineError>(())
                },
            );
            done.unwrap();
            if left > 0 {
                let again = |_: &_| {
                    left -= 1;
                    left > 0
                };
                driver.repeat_trace(query, again).unwrap();
            }
        }
        (records, log_of(driver))
    }

    #[test]
    fn warm_up_does_not_change_frames() {
        // One more trace is in flight when enough have finished.
        const ASKED: usize = 50;
        const DONE: usize = ASKED + 1;
        let lockstep = Policy::Lockstep(3);
        let others = [Policy::Rebuild, Policy::Refit, Policy::DeviceRebuild];
        let others = others.map(|update| (update, false));
        for by in [(lockstep, true), (lockstep, false)]
            .into_iter()
            .chain(others)
        {
            let (plain, log) = run(by, 0);
            let (after, more) = run(by, ASKED);
            // The parts of a frame's statistics that do not depend on a clock.
            let facts = |r: &FrameRecord| {
                let tree = (r.tree.generation, r.tree.age_frames);
                (r.frame, tree, [r.tree.adopted, r.tree.rejected])
            };
            assert!(
                plain.iter().map(facts).eq(after.iter().map(facts)),
                "{by:?}"
            );
            assert_eq!(log.adopted_trees, more.adopted_trees, "{by:?}");
            assert_eq!(more.rebuilt.len(), log.rebuilt.len(), "{by:?}");
            assert_eq!(more.interpolated, log.interpolated, "{by:?}");
            assert_eq!(more.refitted, log.refitted, "{by:?}");
            assert_eq!(more.traced.len(), log.traced.len() + DONE, "{by:?}");
            let again = &more.traced[1..=DONE];
            assert!(again.iter().all(|&t| t == more.traced[0]), "{by:?}");
        }
    }

    /// Returns whether consecutive frames of `ms` milliseconds each are steady.
    fn steady(ms: impl IntoIterator<Item = f64>) -> bool {
        let mut now = 0.0;
        let seen = ms.into_iter().map(|ms| {
            now += ms * 1e-3;
            TimedTrace {
                finished: now,
                device_ms: ms,
            }
        });
        is_steady(&seen.collect::<Vec<_>>())
    }

    #[test]
    fn steady_requires_two_equal_windows() {
        assert!(steady(vec![1.0; 250]));
        assert!(!steady(vec![1.0; 90]), "one window alone");
        // The clock rose at the end of the earlier window.
        let rising = [vec![4.0; 30], vec![1.0; 110]].concat();
        assert!(!steady(rising.clone()));
        assert!(steady([rising, vec![1.0; 100]].concat()));
        // One delayed frame does not affect the median.
        let mut held_up = vec![1.0; 250];
        held_up[240] = 30.0;
        assert!(steady(held_up));
        // A window has at least three frames, however slow they are.
        assert!(!steady(vec![400.0; 5]));
        assert!(steady(vec![400.0; 6]));
        assert!(!steady([400.0, 400.0, 400.0, 300.0, 300.0, 300.0]));
        assert!(!steady([]));
    }
}
