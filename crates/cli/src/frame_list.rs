//! Options that select frames, and the frames and times of a run and of each shard.

use crate::error::CliError;
use crate::parsers::finite;
use crate::table::{KEY_FRAMES, counted};
use pipeline::Frame;
use std::str::FromStr;

/// Default number of frames of a demo: two seconds of film.
const DEMO_FRAMES: usize = 48;
/// Maximum default number of frames of a scene that is not a demo.
const MAX_DEFAULT_FRAMES: usize = 96;

const MAX_FRAMES: usize = 1_000_000;

/// Value of `--frames`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum FrameChoice {
    /// A number of frames, spread evenly over the time range.
    Count(usize),
    /// Frames at the key frames with these indices, in this order.
    Keys(Vec<usize>),
}

/// Value of `--shard`: one of several blocks of about equal size that the list of frames is divided into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Number of the block, from 1.
    pub(crate) number: usize,
    /// Number of blocks.
    pub(crate) of: usize,
}

/// Value of `--time-range`, in key frames, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimeRange {
    pub(crate) from: f64,
    pub(crate) to: f64,
}

impl FromStr for TimeRange {
    type Err = String;

    /// Parses `T0..T1`, finite and in order.
    fn from_str(text: &str) -> Result<Self, String> {
        let says = "a time range is T0..T1, such as 0..7.5";
        let (a, b) = text.split_once("..").ok_or(says)?;
        let (from, to) = (finite(a)?, finite(b)?);
        if from > to {
            return Err(format!("the range is reversed; did you mean {b}..{a}?"));
        }
        Ok(Self { from, to })
    }
}

impl FromStr for FrameChoice {
    type Err = String;

    /// Parses `N`, `A..B` or a list of key times. A key time is the index of a key frame.
    fn from_str(text: &str) -> Result<Self, String> {
        let frames = if text.contains(['.', ',', '-']) {
            Self::Keys(key_times(text)?)
        } else {
            Self::Count(whole(text)?)
        };
        let count = match &frames {
            Self::Count(n) => *n,
            Self::Keys(keys) => keys.len(),
        };
        match count {
            0 => Err("there must be at least one frame".to_owned()),
            n if n > MAX_FRAMES => Err(too_many(n)),
            _ => Ok(frames),
        }
    }
}

fn whole(text: &str) -> Result<usize, String> {
    (text.parse()).map_err(|e| format!("'{text}' is not a whole number: {e}"))
}

fn too_many(n: usize) -> String {
    format!("{n} frames are more than the limit of {MAX_FRAMES}")
}

/// Parses numbers and ranges `A..B`, `A-B` and `A-BxSTEP`, separated by commas. Each key time may occur once.
fn key_times(text: &str) -> Result<Vec<usize>, String> {
    let mut keys = Vec::new();
    for part in text.split(',').filter(|part| !part.is_empty()) {
        let (from, end, step) = range(part)?;
        let count = end.saturating_sub(from).div_ceil(step);
        let all = count.saturating_add(keys.len());
        if all > MAX_FRAMES {
            return Err(too_many(all));
        }
        keys.extend((from..end).step_by(step));
    }
    let mut sorted = keys.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(twice) => Err(format!("key time {} is listed twice", twice[0])),
        None => Ok(keys),
    }
}

/// Returns the next key time.
fn after(key: usize) -> Result<usize, String> {
    key.checked_add(1)
        .ok_or_else(|| format!("key time {key} is too large"))
}

/// Parses one part of the list. Returns the first key time, one past the last, and the step.
fn range(part: &str) -> Result<(usize, usize, usize), String> {
    if let Some((a, b)) = part.split_once("..") {
        let (from, to) = (whole(a)?, whole(b)?);
        if from > to {
            return Err(format!("the range is reversed; did you mean {to}..{from}?"));
        }
        return Ok((from, to, 1));
    }
    let Some((a, rest)) = part.split_once('-') else {
        let key = whole(part)?;
        return Ok((key, after(key)?, 1));
    };
    let (b, step) = rest.split_once('x').unwrap_or((rest, "1"));
    let (from, last, step) = (whole(a)?, whole(b)?, whole(step)?);
    match step {
        0 => Err(format!("the step of '{part}' is 0")),
        _ if from > last => Err(format!(
            "the range is reversed; did you mean {last}-{from}?"
        )),
        _ => Ok((from, after(last)?, step)),
    }
}

impl FromStr for Shard {
    type Err = String;

    /// Parses `I/N`, counted from 1, or `auto`, which uses the variables that Slurm sets for each task of a job array.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return slurm_shard(&|name| std::env::var(name).ok());
        }
        let says = "a shard is I/N, such as 2/8, or auto";
        let (number, of) = text.split_once('/').ok_or(says)?;
        let (number, of) = (whole(number)?, whole(of)?);
        if !(1..=of).contains(&number) {
            return Err(format!(
                "there is no shard {number} of {of}: shards are numbered from 1"
            ));
        }
        Ok(Self { number, of })
    }
}

fn slurm_shard(variable: &dyn Fn(&str) -> Option<String>) -> Result<Shard, String> {
    let number = |name: &str| match variable(name) {
        Some(text) => whole(&text).map_err(|e| format!("{name}: {e}")),
        None => Err(format!(
            "auto needs {name}, which Slurm sets for each task of a job array"
        )),
    };
    let id = number("SLURM_ARRAY_TASK_ID")?;
    let least = number("SLURM_ARRAY_TASK_MIN")?;
    let of = number("SLURM_ARRAY_TASK_COUNT")?;
    match id.checked_sub(least).filter(|i| *i < of) {
        Some(i) => Ok(Shard { number: i + 1, of }),
        None => Err(format!(
            "task {id} is not among the {of} tasks from {least}: the job array must have no gaps"
        )),
    }
}

/// Returns the frames of a run over a motion with `keys` key frames. Frames at key times are numbered by key time,
/// others from 0.
pub(crate) fn list(
    frames: Option<&FrameChoice>,
    range: Option<TimeRange>,
    keys: usize,
    is_demo: bool,
) -> Result<Vec<Frame>, CliError> {
    if let Some(FrameChoice::Keys(list)) = frames {
        let why = "--frames already lists key times: remove --time-range";
        return range.map_or_else(|| at_keys(list, keys), |_| Err(CliError::invalid(why)));
    }
    let end = (keys - 1) as f64;
    let even = EvenFrames::of(frames, range, keys, is_demo);
    let TimeRange { from, to } = even.range;
    if from < 0.0 || to > end {
        let why = format!("is outside the motion, which lasts from 0 to {end} key frames");
        return Err(CliError::invalid(format!(
            "--time-range {from}..{to} {why}"
        )));
    }
    let numbered = (0..).zip(even.times());
    let frames = numbered.map(|(index, time)| Frame { index, time });
    Ok(frames.collect())
}

fn at_keys(list: &[usize], keys: usize) -> Result<Vec<Frame>, CliError> {
    let most = list.iter().max().copied().unwrap_or_default();
    if most >= keys {
        let verb = if keys == 1 { "is" } else { "are" };
        let (count, keys) = (list.len(), counted(keys, KEY_FRAMES));
        return Err(CliError::invalid(format!(
            "--frames lists {count} key times up to {most}, but there {verb} {keys}"
        )));
    }
    let frame = |&k: &usize| Frame {
        index: k as u64,
        time: k as f64,
    };
    Ok(list.iter().map(frame).collect())
}

/// Returns the frames of one shard, or all frames without a shard.
pub(crate) fn of_shard(frames: &[Frame], shard: Option<Shard>) -> Vec<Frame> {
    let Some(Shard { number, of }) = shard else {
        return frames.to_vec();
    };
    let end = |blocks: usize| (frames.len() as u128 * blocks as u128 / of as u128) as usize;
    frames[end(number - 1)..end(number)].to_vec()
}

/// Checks that a time is within the motion.
pub(crate) fn check_time(option: &str, time: f64, keys: usize) -> Result<f64, CliError> {
    let end = (keys - 1) as f64;
    if (0.0..=end).contains(&time) {
        return Ok(time);
    }
    Err(CliError::invalid(format!(
        "{option} {time} lies outside the motion, which lasts from 0 to {end} key frames"
    )))
}

/// Frames that are spread evenly over a time range.
pub(crate) struct EvenFrames {
    pub(crate) count: usize,
    pub(crate) range: TimeRange,
}

impl EvenFrames {
    /// Returns the number and the time range of evenly spread frames.
    pub(crate) fn of(
        frames: Option<&FrameChoice>,
        range: Option<TimeRange>,
        keys: usize,
        is_demo: bool,
    ) -> Self {
        let range = range.unwrap_or(TimeRange {
            from: 0.0,
            to: (keys - 1) as f64,
        });
        let count = match (frames, range.to - range.from) {
            (Some(FrameChoice::Count(n)), _) => *n,
            (_, 0.0) => 1,
            _ if is_demo => DEMO_FRAMES,
            // One per key frame, up to a limit.
            (_, length) => {
                let count = length.min(MAX_DEFAULT_FRAMES as f64) as usize + 1;
                count.clamp(2, MAX_DEFAULT_FRAMES)
            }
        };
        Self { count, range }
    }

    /// Returns the times of all frames, both ends included. If the range begins and ends at key frames, the times of
    /// frames at key frames have no rounding errors.
    fn times(&self) -> Vec<f64> {
        let TimeRange { from, to } = self.range;
        let steps = (self.count.max(2) - 1) as f64;
        let at = |i: usize| from + (to - from) * i as f64 / steps;
        let mut times: Vec<f64> = (0..self.count).map(at).collect();
        if let Some(last) = times.get_mut(1..).and_then(<[f64]>::last_mut) {
            *last = to;
        }
        times
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn shards_partition_frames_evenly(count in 0_u64..200, of in 1_usize..40) {
            let frame = |index| Frame { index, time: index as f64 };
            let all: Vec<_> = (0..count).map(frame).collect();
            let shard = |number| of_shard(&all, Some(Shard { number, of }));
            let shards: Vec<_> = (1..=of).map(shard).collect();
            prop_assert_eq!(shards.concat(), all);
            let lengths = || shards.iter().map(Vec::len);
            prop_assert!(lengths().max() <= lengths().min().map(|least| least + 1));
        }

        #[test]
        fn frame_lists_have_no_duplicates(text in "[0-9.,x-]{0,12}") {
            if let Ok(FrameChoice::Keys(mut keys)) = text.parse() {
                let count = keys.len();
                keys.sort_unstable();
                keys.dedup();
                prop_assert_eq!(keys.len(), count);
            }
        }
    }

    fn times(
        frames: Option<FrameChoice>,
        range: Option<TimeRange>,
        keys: usize,
    ) -> Option<Vec<f64>> {
        let list = list(frames.as_ref(), range, keys, false).ok()?;
        let number = |i: usize, f: &Frame| match frames {
            Some(FrameChoice::Keys(_)) => f.index == f.time as u64,
            _ => f.index == i as u64,
        };
        assert!(list.iter().enumerate().all(|(i, f)| number(i, f)));
        Some(list.iter().map(|f| f.time).collect())
    }

    #[test]
    fn frame_times_follow_counts_and_keys() {
        let count = |n| Some(FrameChoice::Count(n));
        let keys = |from, to| Some(FrameChoice::Keys((from..to).collect()));
        let range = |from, to| Some(TimeRange { from, to });
        for (frames, within, key_times, expected) in [
            (count(3), None, 5, vec![0.0, 2.0, 4.0]),
            (count(3), range(0.5, 1.5), 5, vec![0.5, 1.0, 1.5]),
            (count(1), None, 5, vec![0.0]),
            (count(3), None, 1, vec![0.0; 3]),
            (count(53), None, 53, (0..53).map(f64::from).collect()),
            (keys(1, 4), None, 4, vec![1.0, 2.0, 3.0]),
            (None, None, 1, vec![0.0]),
            (None, None, 4, vec![0.0, 1.0, 2.0, 3.0]),
        ] {
            assert_eq!(times(frames, within, key_times), Some(expected));
        }
        for (frames, within) in [
            (keys(1, 5), None),
            (keys(1, 3), range(0.0, 1.0)),
            (None, range(0.0, 3.5)),
            (None, range(-1.0, 2.0)),
        ] {
            assert_eq!(times(frames, within, 4), None);
        }
        assert!(check_time("--time", 3.0, 4).is_ok() && check_time("--time", 3.1, 4).is_err());
        assert_eq!(times(None, None, 500).unwrap().len(), 96);
        assert_eq!(list(None, None, 16, true).unwrap().len(), 48);
    }

    #[test]
    fn parses_frame_counts_and_ranges() {
        assert_eq!("8".parse(), Ok(FrameChoice::Count(8)));
        assert_eq!("2..5".parse(), Ok(FrameChoice::Keys(vec![2, 3, 4])));
        let list = vec![1, 4, 10, 12, 14, 16, 18, 20];
        assert_eq!("1,4,10-20x2".parse(), Ok(FrameChoice::Keys(list)));
        assert_eq!("7,".parse(), Ok(FrameChoice::Keys(vec![7])));
        let bad = "0 .. 5..2 3..3 -1 1.5 2.. 0..2000000 2000000 18446744073709551615 \
            1,1 3-5,4 5-3 1-9x0 1- 1,x 0-4000000000 , \
            1,0-18446744073709551615 1,2,0-18446744073709551614 18446744073709551615, \
            3,18446744073709551615 0..18446744073709551615 0-18446744073709551615x18446744073709551615";
        for bad in bad.split_whitespace().chain([""]) {
            assert!(bad.parse::<FrameChoice>().is_err(), "{bad}");
        }
    }

    #[test]
    fn time_ranges_are_finite_and_in_order() {
        let range = |from, to| Ok(TimeRange { from, to });
        assert_eq!("0.5..3".parse(), range(0.5, 3.0));
        assert_eq!("2..2".parse(), range(2.0, 2.0));
        for bad in ["3..1", "1", "nan..1", "0..inf", "a..b"] {
            assert!(bad.parse::<TimeRange>().is_err(), "{bad}");
        }
    }

    #[test]
    fn parses_shards_and_slurm_variables() {
        assert_eq!("2/8".parse(), Ok(Shard { number: 2, of: 8 }));
        for bad in ["0/8", "9/8", "8", "a/b", "1/0", ""] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
        let task = |id: &'static str| {
            slurm_shard(&move |name| match name {
                "SLURM_ARRAY_TASK_ID" => Some(id.to_owned()),
                "SLURM_ARRAY_TASK_MIN" => Some("10".to_owned()),
                _ => Some("4".to_owned()),
            })
        };
        assert_eq!(task("10"), Ok(Shard { number: 1, of: 4 }));
        assert_eq!(task("13"), Ok(Shard { number: 4, of: 4 }));
        assert!(task("14").is_err() && task("9").is_err() && task("x").is_err());
        let missing = slurm_shard(&|_| None).unwrap_err();
        assert!(missing.contains("SLURM_ARRAY_TASK_ID"));
    }
}
