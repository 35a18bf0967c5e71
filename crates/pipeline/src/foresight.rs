//! Where the motion will be when a tree that is asked for now is in use.
//!
//! Key frames are known before they are reached. So a tree may be built for
//! the moment it is used instead of the one it is asked for, if somebody
//! guesses when that is. The guess: frames go on by the last step of time, and
//! trees take as long as the last ones did.

/// Watches frames go by and trees come; guesses what comes next.
#[derive(Clone, Debug)]
pub(crate) struct Foresight {
    range: [f64; 2],
    time: f64,
    step: f64,
    /// Frames between asking for a tree and swapping to it; 0 as long as none came.
    latency: f64,
    /// Whether that is so by agreement.
    agreed: bool,
}

impl Foresight {
    /// Frames will lie within `range`; `agreed` is the latency if it is fixed.
    pub(crate) fn new(range: [f64; 2], agreed: Option<u32>) -> Self {
        Self {
            range,
            time: f64::NAN,
            step: 0.0,
            latency: agreed.map_or(0.0, f64::from),
            agreed: agreed.is_some(),
        }
    }

    /// The next frame is at `time`.
    pub(crate) fn frame(&mut self, time: f64) {
        self.step = if self.time.is_nan() {
            0.0
        } else {
            time - self.time
        };
        self.time = time;
    }

    /// A tree came so many frames after it was asked for.
    pub(crate) fn came_after(&mut self, frames: u64) {
        if !self.agreed {
            let seen = frames as f64;
            self.latency = if self.latency > 0.0 {
                f64::midpoint(self.latency, seen)
            } else {
                seen
            };
        }
    }

    /// The middle of the frames traced with a tree asked for now: the next one
    /// will be asked for when it is swapped in, and take as long.
    pub(crate) fn middle_of_use(&self) -> f64 {
        let frames = self.latency + (self.latency - 1.0).max(0.0) / 2.0;
        let [first, last] = self.range;
        let time = self.time + self.step * frames;
        // A frame outside the range is its own best guess.
        time.clamp(first.min(self.time), last.max(self.time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watching(range: [f64; 2], agreed: Option<u32>, times: &[f64]) -> Foresight {
        let mut f = Foresight::new(range, agreed);
        times.iter().for_each(|&t| f.frame(t));
        f
    }

    #[test]
    fn a_steady_motion_is_continued_to_the_middle_of_the_trees_use() {
        let mut f = watching([0.0, 100.0], None, &[0.0, 0.5, 1.0]);
        assert_eq!(f.middle_of_use(), 1.0);
        f.came_after(4);
        // Swapped in 4 frames on, used for frames 4 to 7 from now.
        assert_eq!(f.middle_of_use(), 1.0 + 5.5 * 0.5);
        // The mean of both is 6: used for frames 6 to 11.
        f.came_after(8);
        assert_eq!(f.middle_of_use(), 1.0 + 8.5 * 0.5);
    }

    #[test]
    fn an_agreed_latency_is_not_learned() {
        let mut f = watching([0.0, 100.0], Some(3), &[0.0, 1.0]);
        f.came_after(50);
        assert_eq!(f.middle_of_use(), 5.0);
        let f = watching([0.0, 100.0], Some(0), &[0.0, 1.0]);
        assert_eq!(f.middle_of_use(), 1.0);
    }

    #[test]
    fn no_guess_leaves_the_range_but_for_a_frame_outside_it() {
        let f = watching([2.0, 9.0], Some(10), &[3.0, 4.0]);
        assert_eq!(f.middle_of_use(), 9.0);
        let back = watching([2.0, 9.0], Some(10), &[4.0, 3.0]);
        assert_eq!(back.middle_of_use(), 2.0);
        let outside = watching([2.0, 9.0], Some(10), &[10.0, 11.0]);
        assert_eq!(outside.middle_of_use(), 11.0);
        let first = watching([2.0, 9.0], Some(10), &[3.0]);
        assert_eq!(first.middle_of_use(), 3.0);
    }
}
