//! Frames that nobody counts: a device that had nothing to do runs at a low clock, and takes long to leave it.
//!
//! Opening a device, compiling kernels and building a first tree leave it idle for milliseconds to seconds. So a run's
//! first frame, which waits for all of that, is followed by traces of it that nobody counts, for a while and until they
//! take as long as they did before. The scene does not move on, and no tree ages ([`Driver::warm_up`]).

use super::{Driver, PipelineError, Wanted};
use crate::frame::{Frame, FrameRecord};
use crate::schedule::{Pace, Update};
use crate::tree_builder::TreeBuilder;
use backend::{DeviceKind, FRAMES_IN_FLIGHT, FrameReport, Query};
use bvh_build::Cancel;
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Instant;

/// Seconds that a graphics processor is warmed up unless asked otherwise. On an H200 that had waited ten seconds for its
/// kernels, 60 frames of a quarter of a second in all were still four times too slow.
const USUAL: f64 = 0.7;
/// Seconds over which two medians are compared, one window after the other.
const WINDOW: f64 = 0.1;
/// Frames in a window at least.
const FEWEST: usize = 3;
/// Medians that differ by less than this share agree.
const AGREE: f64 = 0.03;
/// Seconds that go on in vain until medians agree.
const PATIENCE: f64 = 0.5;

/// How a device was warmed up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Warmed {
    /// By the host's clock.
    pub seconds: f64,
    /// Traces of the first frame.
    pub frames: usize,
    /// Whether they took the same time in the end.
    pub steady: bool,
}

/// Seconds for a device; the host's cores have no use for it, and a driver that runs there only if it is asked for.
fn seconds(asked: Option<f64>, kind: DeviceKind) -> f64 {
    match kind {
        DeviceKind::Cpu => 0.0,
        DeviceKind::Gpu => asked.unwrap_or(USUAL),
        DeviceKind::Software => asked.unwrap_or(0.0),
    }
}

/// Runs the first frame and warms the device up after it, if it needs that, for so many seconds if somebody said so.
/// Hands back the frames that are left.
///
/// # Errors
/// The backend's, or whatever `on_frame` returns.
pub fn warm_up<'a, E: From<PipelineError>>(
    asked: Option<f64>,
    driver: &mut Driver,
    frames: &'a [Frame],
    query: Query<'_>,
    mut on_frame: impl FnMut(&FrameRecord) -> Result<(), E>,
) -> Result<(Option<Warmed>, &'a [Frame]), E> {
    let kind = driver.backend().device().kind;
    // Nothing comes after a single frame that could gain by it.
    if seconds(asked, kind) <= 0.0 || frames.len() < 2 {
        return Ok((None, frames));
    }
    let (first, rest) = frames.split_at(1);
    driver.run(
        first.iter().copied(),
        query,
        Wanted::default(),
        |record, _| on_frame(record),
    )?;
    let mut progress = WarmUp::begin(asked, kind);
    driver.warm_up(query, |report: &FrameReport| {
        let goes_on = |progress: &mut WarmUp| progress.goes_on(report.times.device_ms);
        progress.as_mut().is_some_and(goes_on)
    })?;
    Ok((progress.map(WarmUp::end), rest))
}

/// A warm-up in progress.
#[derive(Debug)]
pub struct WarmUp {
    begun: Instant,
    seconds: f64,
    seen: Vec<Moment>,
}

impl WarmUp {
    /// Begins a warm-up of `asked` seconds, or as long as is usual on such a device. `None` if it needs none.
    #[must_use]
    pub fn begin(asked: Option<f64>, kind: DeviceKind) -> Option<Self> {
        let seconds = seconds(asked, kind);
        (seconds > 0.0).then(|| Self {
            begun: Instant::now(),
            seconds,
            seen: Vec::new(),
        })
    }

    /// Takes the device's milliseconds of a trace. Returns whether another trace should follow.
    pub fn goes_on(&mut self, device_ms: f64) -> bool {
        let now = self.begun.elapsed().as_secs_f64();
        self.seen.push((now, device_ms));
        now < self.seconds || (now < self.seconds + PATIENCE && !is_steady(&self.seen))
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

/// When a frame was done, in seconds, and the device's milliseconds for it.
type Moment = (f64, f64);

/// Whether the last window's frames took as long as those of the window before. A clock rises in steps, so that
/// neighbours always agree.
fn is_steady(seen: &[Moment]) -> bool {
    let (earlier, last) = window(seen);
    let (_, before) = window(earlier);
    let [a, b] = [before, last].map(median);
    before.len().min(last.len()) >= FEWEST && (a - b).abs() <= AGREE * a.max(b)
}

/// The middle one of their times; of an even number, the later of two.
fn median(of: &[Moment]) -> f64 {
    let mut times: Vec<f64> = of.iter().map(|m| m.1).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Parts off the last frames that fill a window.
fn window(all: &[Moment]) -> (&[Moment], &[Moment]) {
    let end = all.last().map_or(0.0, |&(at, _)| at);
    let within = all.iter().rev().take_while(|(at, _)| end - at < WINDOW);
    let count = within.count().max(FEWEST).min(all.len());
    all.split_at(all.len() - count)
}

impl Driver {
    /// Traces `query` with the last frame's tree at the last frame's positions, again and again as long as `again`
    /// wants, which hears what the device says of each. As many as the backend allows are under way, so that the device
    /// never waits for the host.
    ///
    /// No tree ages, no time goes on, nobody is asked for a tree: the frames to come are what they would have been.
    /// (A build in flight goes on meanwhile; there is none yet after the first frame.) A builder that runs free first
    /// makes a tree that is thrown away, so that those to come find their memory: see `TreeBuilder::warm_up`.
    ///
    /// # Errors
    /// The backend's.
    ///
    /// # Panics
    /// Before the first frame, or while a frame is under way.
    pub fn warm_up(
        &mut self,
        query: Query<'_>,
        mut again: impl FnMut(&FrameReport) -> bool,
    ) -> Result<(), PipelineError> {
        self.warm_up_builder();
        assert!(self.tree.is_some(), "a frame comes first");
        assert!(self.pending.is_empty(), "a frame is under way");
        let mut under_way = VecDeque::with_capacity(FRAMES_IN_FLIGHT);
        let mut wanted = true;
        loop {
            while wanted && under_way.len() < FRAMES_IN_FLIGHT {
                self.backend.trace(query)?;
                under_way.push_back(self.backend.submit()?);
            }
            let Some(ticket) = under_way.pop_front() else {
                return Ok(());
            };
            let report = self.backend.wait(ticket)?;
            wanted = wanted && again(&report);
        }
    }

    /// Warms the builder up, if one is to run free and has nothing to do.
    fn warm_up_builder(&self) {
        let runs_free = self.options.update == Update::Async(Pace::Free);
        if let Some(pose) = self.pose.filter(|_| runs_free && self.candidate.is_none()) {
            // Nothing comes of it either way; the first tree that counts will tell what is wrong.
            let animation = &self.animation;
            let warmed =
                |builder: &mut TreeBuilder| builder.warm_up(animation, pose, &Cancel::new());
            let _ = self.builder_pool.with(warmed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::tests::{Policy, drifting, driver, fake::Fake, fake::Log, query, read};
    use backend::QueryKind;
    use std::sync::Arc;

    /// Runs frames, after the first of which so many traces are done uncounted.
    fn run(by: Policy, mut left: usize) -> (Vec<FrameRecord>, Log) {
        let fake = Fake::new(Some(0));
        let log = Arc::clone(&fake.log);
        let mut driver = driver(fake, &drifting(30), by).unwrap();
        let query = query(QueryKind::Closest);
        let mut records = Vec::new();
        let frame = |index| Frame {
            index,
            time: index as f64 * 1.4,
        };
        for part in [0..1, 1..20] {
            let done = driver.run(part.map(frame), query, Wanted::default(), |record, _| {
                records.push(record.clone());
                Ok::<(), PipelineError>(())
            });
            done.unwrap();
            if left > 0 {
                let again = |_: &_| {
                    left -= 1;
                    left > 0
                };
                driver.warm_up(query, again).unwrap();
            }
        }
        drop(driver);
        (records, read(log))
    }

    #[test]
    fn frames_are_the_same_whatever_was_warmed_up() {
        // One more is under way when there are enough.
        const ASKED: usize = 50;
        const DONE: usize = ASKED + 1;
        let lockstep = Update::Async(Pace::Lockstep(3));
        let others = [
            Update::Rebuild,
            Update::Refit,
            Update::TSah,
            Update::DeviceRebuild,
        ];
        let others = others.map(|update| (update, false));
        for by in [(lockstep, true), (lockstep, false)]
            .into_iter()
            .chain(others)
        {
            let (plain, log) = run(by, 0);
            let (after, more) = run(by, ASKED);
            // What a frame says that no clock decides.
            let facts = |r: &FrameRecord| {
                let flags = [r.adopted.is_some(), r.made, r.rejected.is_some()];
                let tree = (r.tree_generation, r.tree_age_frames, r.asked);
                (r.frame, tree, flags)
            };
            assert!(
                plain.iter().map(facts).eq(after.iter().map(facts)),
                "{by:?}"
            );
            assert_eq!(log.trees, more.trees, "{by:?}");
            assert_eq!(more.made.len(), log.made.len(), "{by:?}");
            assert_eq!(more.interpolated, log.interpolated, "{by:?}");
            assert_eq!(more.refitted, log.refitted, "{by:?}");
            assert_eq!(more.traced.len(), log.traced.len() + DONE, "{by:?}");
            let again = &more.traced[1..=DONE];
            assert!(again.iter().all(|&t| t == more.traced[0]), "{by:?}");
        }
    }

    /// Whether frames of so many milliseconds each, one after the other, are steady.
    fn steady(ms: impl IntoIterator<Item = f64>) -> bool {
        let mut now = 0.0;
        let seen = ms.into_iter().map(|ms| {
            now += ms * 1e-3;
            (now, ms)
        });
        is_steady(&seen.collect::<Vec<_>>())
    }

    #[test]
    fn frames_are_steady_once_two_windows_agree() {
        assert!(steady(vec![1.0; 250]));
        assert!(!steady(vec![1.0; 90]), "one window alone");
        // A clock that rose at the end of the window before.
        let rising = [vec![4.0; 30], vec![1.0; 110]].concat();
        assert!(!steady(rising.clone()));
        assert!(steady([rising, vec![1.0; 100]].concat()));
        // One frame that something else held up counts for nothing.
        let mut held_up = vec![1.0; 250];
        held_up[240] = 30.0;
        assert!(steady(held_up));
        // Slow frames need three a window.
        assert!(!steady(vec![400.0; 5]));
        assert!(steady(vec![400.0; 6]));
        assert!(!steady([400.0, 400.0, 400.0, 300.0, 300.0, 300.0]));
        assert!(!steady([]));
    }

    #[test]
    fn only_devices_are_warmed_up_and_software_if_it_is_asked_for() {
        use DeviceKind::{Cpu, Gpu, Software};
        let of = |asked| [Gpu, Software, Cpu].map(|kind| seconds(asked, kind));
        assert_eq!(of(None), [USUAL, 0.0, 0.0]);
        assert_eq!(of(Some(2.0)), [2.0, 2.0, 0.0]);
        assert_eq!(of(Some(0.0)), [0.0; 3]);
    }
}
