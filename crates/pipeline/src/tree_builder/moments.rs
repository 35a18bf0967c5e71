//! Vertices at the moments that a tree is made for.

use super::Vertices;
use backend::Snapshot;
use geom::{Animation, KeyFrame, KeyFrameError, Moment, Point, PointBuffer, Pose};
use rayon::prelude::*;
use std::mem::take;
use std::sync::Arc;

/// Vertices that a thread takes at a time, at least.
const RUN: usize = 1 << 12;

/// What the moments of a build are blended from: the animation's key frames, or two that were observed.
pub(crate) struct Moments<'a> {
    pub(super) animation: &'a Animation,
    pub(super) observed: Option<[KeyFrame; 2]>,
}

impl<'a> Moments<'a> {
    /// The animation's.
    pub(crate) fn of(animation: &'a Animation) -> Self {
        Self {
            animation,
            observed: None,
        }
    }

    pub(super) fn at(&self, pose: Pose) -> Result<Moment<'a>, KeyFrameError> {
        match &self.observed {
            Some(frames) => Ok(Moment::new(self.animation, pose, frames.clone())),
            None => self.animation.moment(pose),
        }
    }

    /// Where vertices stand, blended if they have a pose.
    pub(super) fn stand<'v>(
        &self,
        vertices: &'v Vertices,
        blended: &'v mut Vec<Point>,
    ) -> Result<&'v [Point], KeyFrameError> {
        match vertices {
            Vertices::ReadBack(snapshot) => Ok(snapshot),
            Vertices::KeyFrames(pose) => {
                blend(&self.at(*pose)?, blended);
                Ok(blended)
            }
        }
    }
}

/// Where a time stands between and beyond those of two frames that were observed.
pub(crate) fn pose_between([first, second]: [f64; 2], time: f64) -> Pose {
    let alpha = ((time - first) / (second - first)) as f32;
    Pose {
        key: 0,
        // Both may be of one time.
        alpha: if alpha.is_finite() { alpha } else { 1.0 },
    }
}

/// All vertices at a moment.
pub(super) fn blend(moment: &Moment<'_>, positions: &mut Vec<Point>) {
    let vertices = (0..moment.animation().vertex_count() as u32).into_par_iter();
    let all = vertices.with_min_len(RUN).map(|v| moment.vertex(v));
    all.collect_into_vec(positions);
}

/// Copies what was observed into the memory of a key frame that nobody needs, so that the backend has its own again.
pub(super) fn keep((seen, frame): (Snapshot, &mut KeyFrame)) {
    let mut list = match Arc::get_mut(frame).map(take) {
        Some(PointBuffer::List(list)) => list,
        _ => Vec::new(),
    };
    let all = seen.par_iter().with_min_len(RUN);
    all.copied().collect_into_vec(&mut list);
    *frame = Arc::new(list.into());
}
