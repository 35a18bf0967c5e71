//! What is known of the frames to come.

use crate::args::Switch;
use pipeline::Frame;

/// What trees may be built for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ahead {
    /// The first and the last time of all frames, in key frames.
    pub(crate) time_range: [f64; 2],
    /// Whether `async` builds for what comes.
    pub(crate) predict: bool,
}

impl Default for Ahead {
    /// The whole motion.
    fn default() -> Self {
        Self {
            time_range: [0.0, f64::INFINITY],
            predict: true,
        }
    }
}

impl Ahead {
    /// These frames.
    pub(crate) fn of(frames: &[Frame], predict: Switch) -> Self {
        let times = || frames.iter().map(|f| f.time);
        let first = times().fold(f64::INFINITY, f64::min);
        let last = times().fold(0.0, f64::max);
        Self {
            time_range: [first.min(last), last],
            predict: predict == Switch::On,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_last_from_the_earliest_to_the_latest() {
        let frames = [3.0, 1.5, 2.0].map(|time| Frame { index: 0, time });
        let ahead = Ahead::of(&frames, Switch::Off);
        assert_eq!((ahead.time_range, ahead.predict), ([1.5, 3.0], false));
        assert_eq!(Ahead::of(&[], Switch::On).time_range, [0.0, 0.0]);
    }
}
