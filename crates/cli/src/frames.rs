//! From what was asked for to times.

use crate::stop::Stop;
use crate::table::{KEY_FRAMES, counted};
use crate::values::{Frames, TimeRange};
use pipeline::Frame;

/// What the name of every demo begins with.
pub(crate) const DEMO: &str = "demo:";
/// Frames of a demo unless asked otherwise: two seconds of film.
const DEMO_FRAMES: usize = 48;
/// The most frames of anything else unless asked otherwise.
const MOST_FRAMES: usize = 96;

/// The frames to render of a motion with `keys` key frames, numbered from 0.
pub(crate) fn list(
    frames: Option<Frames>,
    range: Option<TimeRange>,
    keys: usize,
    is_demo: bool,
) -> Result<Vec<Frame>, Stop> {
    let end = (keys - 1) as f64;
    let range = within(range, end)?;
    let times: Vec<f64> = match frames {
        Some(Frames::Keys { .. }) if range.is_some() => {
            let e = "--frames A..B names key times already: leave --time-range out";
            return Err(Stop::bad(e));
        }
        Some(Frames::Keys { to, .. }) if to > keys => {
            let verb = if keys == 1 { "is" } else { "are" };
            let keys = counted(keys, KEY_FRAMES);
            let e = format!("--frames ends before {to}, but there {verb} {keys}");
            return Err(Stop::bad(e));
        }
        Some(Frames::Keys { from, to }) => (from..to).map(|k| k as f64).collect(),
        Some(Frames::Count(n)) => spread(range.unwrap_or(TimeRange { from: 0.0, to: end }), n),
        None => {
            let range = range.unwrap_or(TimeRange { from: 0.0, to: end });
            spread(range, default_count(range, is_demo))
        }
    };
    let numbered = (0..).zip(times);
    Ok(numbered
        .map(|(index, time)| Frame { index, time })
        .collect())
}

/// A moment that lies within the motion.
pub(crate) fn moment(option: &str, time: f64, keys: usize) -> Result<f64, Stop> {
    let end = (keys - 1) as f64;
    if (0.0..=end).contains(&time) {
        return Ok(time);
    }
    Err(Stop::bad(format!(
        "{option} {time} lies outside the motion, which lasts from 0 to {end} key frames"
    )))
}

fn within(range: Option<TimeRange>, end: f64) -> Result<Option<TimeRange>, Stop> {
    match range {
        Some(r) if r.from < 0.0 || r.to > end => Err(Stop::bad(format!(
            "--time-range {}..{} leaves the motion, which lasts from 0 to {end} key frames",
            r.from, r.to
        ))),
        range => Ok(range),
    }
}

fn default_count(range: TimeRange, is_demo: bool) -> usize {
    if range.from == range.to {
        1
    } else if is_demo {
        DEMO_FRAMES
    } else {
        // One a key frame where that is few enough; `list` has checked that the range is short.
        ((range.to - range.from) as usize + 1).clamp(2, MOST_FRAMES)
    }
}

/// `n` times over the range, both ends included; whole times stay whole where they are hit.
fn spread(range: TimeRange, n: usize) -> Vec<f64> {
    let steps = (n.max(2) - 1) as f64;
    let at = |i: usize| range.from + (range.to - range.from) * i as f64 / steps;
    let mut times: Vec<f64> = (0..n).map(at).collect();
    if let Some(last) = times.get_mut(1..).and_then(<[f64]>::last_mut) {
        *last = range.to;
    }
    times
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(frames: Option<Frames>, range: Option<(f64, f64)>, keys: usize) -> Option<Vec<f64>> {
        let range = range.map(|(from, to)| TimeRange { from, to });
        let list = list(frames, range, keys, false).ok()?;
        assert!(list.iter().enumerate().all(|(i, f)| f.index == i as u64));
        Some(list.iter().map(|f| f.time).collect())
    }

    #[test]
    fn a_count_spreads_over_both_ends() {
        let three = Some(Frames::Count(3));
        assert_eq!(times(three, None, 5).unwrap(), [0.0, 2.0, 4.0]);
        assert_eq!(times(three, Some((0.5, 1.5)), 5).unwrap(), [0.5, 1.0, 1.5]);
        assert_eq!(times(Some(Frames::Count(1)), None, 5).unwrap(), [0.0]);
        assert_eq!(times(three, None, 1).unwrap(), [0.0; 3]);
        let all = times(Some(Frames::Count(53)), None, 53).unwrap();
        assert!(all.iter().enumerate().all(|(i, &t)| t == i as f64));
    }

    #[test]
    fn a_range_names_key_times() {
        let keys = |from, to| Some(Frames::Keys { from, to });
        assert_eq!(times(keys(1, 4), None, 4).unwrap(), [1.0, 2.0, 3.0]);
        assert!(times(keys(1, 5), None, 4).is_none());
        assert!(times(keys(1, 3), Some((0.0, 1.0)), 4).is_none());
    }

    #[test]
    fn defaults_follow_the_kind_of_scene() {
        assert_eq!(times(None, None, 1).unwrap(), [0.0]);
        assert_eq!(times(None, None, 4).unwrap(), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(times(None, None, 500).unwrap().len(), 96);
        assert_eq!(list(None, None, 16, true).unwrap().len(), 48);
    }

    #[test]
    fn times_outside_the_motion_are_refused() {
        assert!(times(None, Some((0.0, 3.5)), 4).is_none());
        assert!(times(None, Some((-1.0, 2.0)), 4).is_none());
        assert!(moment("--time", 3.0, 4).is_ok() && moment("--time", 3.1, 4).is_err());
    }
}
