//! Positions that only a backend knows, as they were seen on the host at two times: they are taken to go straight on.

use backend::Snapshot;
use geom::{Animation, KeyFrame, KeyFrameError, Moment, PointBuffer, Pose};
use rayon::prelude::*;
use std::mem::take;
use std::sync::Arc;

/// Positions that a backend was given and gave back, and what a tree of them is for. Times are in steps or key frames.
pub struct Observation {
    /// Where the vertices were, and where they were after that.
    pub positions: [Snapshot; 2],
    /// When.
    pub times: [f64; 2],
    /// The moment that the tree is to be made for.
    pub middle: f64,
    /// Moments early and late in the time that it will be used.
    pub halves: [f64; 2],
}

impl Observation {
    /// Where a time stands between and beyond them.
    pub(super) fn pose(&self, time: f64) -> Pose {
        let [first, second] = self.times;
        let alpha = ((time - first) / (second - first)) as f32;
        Pose {
            key: 0,
            // Both may be of one time.
            alpha: if alpha.is_finite() { alpha } else { 1.0 },
        }
    }
}

/// Copies what was seen into the memory of a key frame that nobody needs, so that the backend has its own again.
pub(super) fn keep(seen: Snapshot, frame: &mut KeyFrame) {
    let mut list = match Arc::get_mut(frame).map(take) {
        Some(PointBuffer::List(list)) => list,
        _ => Vec::new(),
    };
    let all = seen.par_iter().with_min_len(1 << 12);
    all.copied().collect_into_vec(&mut list);
    *frame = Arc::new(list.into());
}

/// What the moments of a build are blended from: the animation's key frames, or two others.
pub(super) struct Moments<'a> {
    pub(super) animation: &'a Animation,
    pub(super) observed: Option<[KeyFrame; 2]>,
}

impl<'a> Moments<'a> {
    /// The animation's.
    pub(super) fn of(animation: &'a Animation) -> Self {
        Self {
            animation,
            observed: None,
        }
    }

    pub(super) fn at(&self, pose: Pose) -> Result<Moment<'a>, KeyFrameError> {
        match &self.observed {
            Some(frames) => Ok(self.animation.moment_between(frames.clone(), pose)),
            None => self.animation.moment(pose),
        }
    }
}
