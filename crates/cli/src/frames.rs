//! From what was asked for to times.

use crate::stop::Stop;
use crate::table::{KEY_FRAMES, counted};
use crate::values::{Frames, Shard, TimeRange};
use pipeline::Frame;

/// What the name of every demo begins with.
pub(crate) const DEMO: &str = "demo:";
/// Frames of a demo unless asked otherwise: two seconds of film.
const DEMO_FRAMES: usize = 48;
/// The most frames of anything else unless asked otherwise.
const MOST_FRAMES: usize = 96;

/// The frames to render of a motion with `keys` key frames. Those at key times have these for numbers, others are
/// numbered from 0 on.
pub(crate) fn list(
    frames: Option<&Frames>,
    range: Option<TimeRange>,
    keys: usize,
    is_demo: bool,
) -> Result<Vec<Frame>, Stop> {
    let end = (keys - 1) as f64;
    let range = within(range, end)?;
    let times: Vec<f64> = match frames {
        Some(Frames::Keys(_)) if range.is_some() => {
            let e = "--frames names key times already: leave --time-range out";
            return Err(Stop::bad(e));
        }
        Some(Frames::Keys(list)) => {
            let most = list.iter().max().copied().unwrap_or_default();
            if most >= keys {
                let verb = if keys == 1 { "is" } else { "are" };
                let (count, keys) = (list.len(), counted(keys, KEY_FRAMES));
                let e = format!(
                    "--frames names {count} key times up to {most}, but there {verb} {keys}"
                );
                return Err(Stop::bad(e));
            }
            let frame = |&k: &usize| Frame {
                index: k as u64,
                time: k as f64,
            };
            return Ok(list.iter().map(frame).collect());
        }
        Some(Frames::Count(n)) => spread(range.unwrap_or(TimeRange { from: 0.0, to: end }), *n),
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

/// The frames, their times aside, where they can be told before the scene is loaded.
pub(crate) fn foreseen(
    frames: Option<&Frames>,
    range: Option<TimeRange>,
    is_demo: bool,
) -> Option<Vec<Frame>> {
    const MANY: usize = 1 << 50;
    let is_told = frames.is_some() || range.is_some();
    is_told.then(|| list(frames, range, MANY, is_demo).ok())?
}

/// Whether a scene is a demo.
pub(crate) fn is_demo(scene: &str) -> bool {
    scene.starts_with(DEMO)
}

/// The frames of one of several blocks of about equal size.
pub(crate) fn of_shard(frames: &[Frame], shard: Option<Shard>) -> Vec<Frame> {
    let Some(Shard { number, of }) = shard else {
        return frames.to_vec();
    };
    let end = |blocks: usize| (frames.len() as u128 * blocks as u128 / of as u128) as usize;
    frames[end(number - 1)..end(number)].to_vec()
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

pub(crate) fn default_count(range: TimeRange, is_demo: bool) -> usize {
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
        let list = list(frames.as_ref(), range, keys, false).ok()?;
        let number = |i: usize, f: &Frame| match frames {
            Some(Frames::Keys(_)) => f.index == f.time as u64,
            _ => f.index == i as u64,
        };
        assert!(list.iter().enumerate().all(|(i, f)| number(i, f)));
        Some(list.iter().map(|f| f.time).collect())
    }

    #[test]
    fn a_count_spreads_over_both_ends() {
        let three = || Some(Frames::Count(3));
        assert_eq!(times(three(), None, 5).unwrap(), [0.0, 2.0, 4.0]);
        assert_eq!(
            times(three(), Some((0.5, 1.5)), 5).unwrap(),
            [0.5, 1.0, 1.5]
        );
        assert_eq!(times(Some(Frames::Count(1)), None, 5).unwrap(), [0.0]);
        assert_eq!(times(three(), None, 1).unwrap(), [0.0; 3]);
        let all = times(Some(Frames::Count(53)), None, 53).unwrap();
        assert!(all.iter().enumerate().all(|(i, &t)| t == i as f64));
    }

    #[test]
    fn a_range_names_key_times() {
        let keys = |from, to| Some(Frames::Keys((from..to).collect()));
        assert_eq!(times(keys(1, 4), None, 4).unwrap(), [1.0, 2.0, 3.0]);
        assert!(times(keys(1, 5), None, 4).is_none());
        assert!(times(keys(1, 3), Some((0.0, 1.0)), 4).is_none());
    }

    #[test]
    fn shards_are_blocks_that_cover_every_frame_once() {
        let all = list(Some(&Frames::Count(10)), None, 3, false).unwrap();
        for of in [1, 3, 10, 25] {
            let shards = (1..=of).map(|number| of_shard(&all, Some(Shard { number, of })));
            let joined: Vec<u64> = shards.flatten().map(|f| f.index).collect();
            assert_eq!(joined, (0..10).collect::<Vec<u64>>(), "{of}");
        }
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
