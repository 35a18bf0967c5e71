//! Which frames of a run, and which share of them.

/// The most frames of one run.
pub(crate) const MAX_FRAMES: usize = 1_000_000;

/// Which frames to render.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Frames {
    /// So many, spread evenly over the time range.
    Count(usize),
    /// Those at these key times, in this order.
    Keys(Vec<usize>),
}

/// One block of a list of frames that is divided evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Which block, from 1 on.
    pub(crate) number: usize,
    pub(crate) of: usize,
}

/// `N` or `A..B`.
pub(crate) fn frames(text: &str) -> Result<Frames, String> {
    let frames = match text.contains(['.', ',', '-']) {
        false => Frames::Count(whole(text)?),
        true => Frames::Keys(key_times(text)?),
    };
    let count = match &frames {
        Frames::Count(n) => *n,
        Frames::Keys(keys) => keys.len(),
    };
    match count {
        0 => Err("there must be at least one frame".to_owned()),
        n if n > MAX_FRAMES => Err(too_many(n)),
        _ => Ok(frames),
    }
}

fn whole(text: &str) -> Result<usize, String> {
    (text.parse()).map_err(|e| format!("'{text}' is no whole number: {e}"))
}

fn too_many(n: usize) -> String {
    format!("{n} frames are more than the limit of {MAX_FRAMES}")
}

/// `A..B`, or numbers and ranges `A-B` and `A-BxSTEP` with commas between them; each key time once.
fn key_times(text: &str) -> Result<Vec<usize>, String> {
    let mut keys = Vec::new();
    for part in text.split(',').filter(|part| !part.is_empty()) {
        let (from, end, step) = range(part)?;
        let count = end.saturating_sub(from).div_ceil(step);
        if keys.len() + count > MAX_FRAMES {
            return Err(too_many(keys.len() + count));
        }
        keys.extend((from..end).step_by(step));
    }
    let mut sorted = keys.clone();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(twice) => Err(format!("key time {} is named twice", twice[0])),
        None => Ok(keys),
    }
}

/// First, one past the last, step.
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
        return Ok((key, key + 1, 1));
    };
    let (b, step) = rest.split_once('x').unwrap_or((rest, "1"));
    let (from, last, step) = (whole(a)?, whole(b)?, whole(step)?);
    match step {
        0 => Err(format!("the step of '{part}' is 0")),
        _ if from > last => Err(format!(
            "the range is reversed; did you mean {last}-{from}?"
        )),
        _ => Ok((from, last.saturating_add(1), step)),
    }
}

/// `I/N`, from 1 on, or `auto`: from the variables that Slurm sets for each task of an array.
pub(crate) fn shard(text: &str) -> Result<Shard, String> {
    if text == "auto" {
        return slurm_shard(&|name| std::env::var(name).ok());
    }
    let (number, of) = text
        .split_once('/')
        .ok_or("a shard is I/N, such as 2/8, or auto")?;
    let (number, of) = (whole(number)?, whole(of)?);
    match (1..=of).contains(&number) {
        true => Ok(Shard { number, of }),
        false => Err(format!(
            "there is no shard {number} of {of}: they are numbered from 1 on"
        )),
    }
}

fn slurm_shard(variable: &dyn Fn(&str) -> Option<String>) -> Result<Shard, String> {
    let number = |name: &str| match variable(name) {
        Some(text) => whole(&text).map_err(|e| format!("{name}: {e}")),
        None => Err(format!(
            "auto needs {name}, which Slurm sets for a task of an array"
        )),
    };
    let id = number("SLURM_ARRAY_TASK_ID")?;
    let (least, of) = (
        number("SLURM_ARRAY_TASK_MIN")?,
        number("SLURM_ARRAY_TASK_COUNT")?,
    );
    match id.checked_sub(least).filter(|i| *i < of) {
        Some(i) => Ok(Shard { number: i + 1, of }),
        None => Err(format!(
            "task {id} is none of {of} from {least} on: the array must have no gaps"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_count_or_a_range_in_order() {
        assert_eq!(frames("8"), Ok(Frames::Count(8)));
        assert_eq!(frames("2..5"), Ok(Frames::Keys(vec![2, 3, 4])));
        let list = vec![1, 4, 10, 12, 14, 16, 18, 20];
        assert_eq!(frames("1,4,10-20x2"), Ok(Frames::Keys(list)));
        assert_eq!(frames("7,"), Ok(Frames::Keys(vec![7])));
        for bad in [
            "0",
            "",
            "..",
            "5..2",
            "3..3",
            "-1",
            "1.5",
            "2..",
            "0..2000000",
            "2000000",
        ] {
            frames(bad).unwrap_err();
        }
        frames("18446744073709551615").unwrap_err();
    }

    #[test]
    fn lists_of_key_times_that_make_no_sense_are_refused() {
        for bad in [
            "1,1",
            "3-5,4",
            "5-3",
            "1-9x0",
            "1-",
            "-1",
            "1,x",
            "0-4000000000",
            ",",
        ] {
            assert!(frames(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn shards_are_numbered_from_one_on_by_hand_or_by_slurm() {
        assert_eq!(shard("2/8"), Ok(Shard { number: 2, of: 8 }));
        for bad in ["0/8", "9/8", "8", "a/b", "1/0", ""] {
            assert!(shard(bad).is_err(), "{bad}");
        }
        let task = |id: &'static str| {
            slurm_shard(&move |name| {
                let text = match name {
                    "SLURM_ARRAY_TASK_ID" => id,
                    "SLURM_ARRAY_TASK_MIN" => "10",
                    _ => "4",
                };
                Some(text.to_owned())
            })
        };
        assert_eq!(task("10"), Ok(Shard { number: 1, of: 4 }));
        assert_eq!(task("13"), Ok(Shard { number: 4, of: 4 }));
        assert!(task("14").is_err() && task("9").is_err() && task("x").is_err());
        assert!(
            slurm_shard(&|_| None)
                .unwrap_err()
                .contains("SLURM_ARRAY_TASK_ID")
        );
    }
}
