//! Work for a device before it is measured: one that had nothing to do runs at a low clock, and takes long to leave it.
//!
//! Opening a device, compiling kernels and building a first tree leave it idle for milliseconds to seconds. So a run's
//! first frame, which waits for all of that, is followed by traces of it that nobody counts, for a while and until they
//! take as long as they did before. The scene does not move on, and no tree ages ([`Driver::warm_up`]).

use crate::{Driver, Frame, FrameRecord, PipelineError, Wanted};
use backend::{DeviceKind, FrameReport, Query};
use serde::Serialize;
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
    let seconds = seconds(asked, driver.backend().device().kind);
    // Nothing comes after a single frame that could gain by it.
    if seconds <= 0.0 || frames.len() < 2 {
        return Ok((None, frames));
    }
    let (first, rest) = frames.split_at(1);
    driver.run(
        first.iter().copied(),
        query,
        Wanted::default(),
        |record, _| on_frame(record),
    )?;
    let warmed = warm(driver, query, [seconds, seconds + PATIENCE])?;
    Ok((Some(warmed), rest))
}

/// For so many seconds at least, and then as long as frames differ, up to so many.
fn warm(
    driver: &mut Driver,
    query: Query<'_>,
    [least, most]: [f64; 2],
) -> Result<Warmed, PipelineError> {
    let begun = Instant::now();
    let mut seen = Vec::new();
    driver.warm_up(query, |report: &FrameReport| {
        let now = begun.elapsed().as_secs_f64();
        seen.push((now, report.times.device_ms));
        now < least || (now < most && !is_steady(&seen))
    })?;
    Ok(Warmed {
        seconds: begun.elapsed().as_secs_f64(),
        frames: seen.len(),
        steady: is_steady(&seen),
    })
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

#[cfg(test)]
mod tests {
    use super::*;

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
