//! Positions of vertices at the poses that a tree is built for.

use super::Vertices;
use backend::Snapshot;
use bvh_build::AnimationBoxes;
use geom::{Animation, KeyFrame, KeyFrameError, Moment, Point, PointBuffer, Pose};
use rayon::prelude::*;
use std::mem::take;
use std::sync::Arc;

/// Minimum number of vertices or triangles per parallel task.
pub(super) const RUN: usize = 1 << 12;

/// Source of the positions of a build: the animation's key frames, or two given frames.
pub(crate) struct PoseSource<'a> {
    pub(super) animation: &'a Animation,
    /// The frames that all poses blend instead of the animation's key frames.
    pub(super) frames: Option<[KeyFrame; 2]>,
}

impl<'a> PoseSource<'a> {
    pub(super) fn at(&self, pose: Pose) -> Result<Moment<'a>, KeyFrameError> {
        match &self.frames {
            Some(frames) => Ok(Moment::new(self.animation, pose, frames.clone())),
            None => self.animation.moment(pose),
        }
    }

    /// Returns the boxes of the animation's triangles with these vertices.
    pub(super) fn boxes<'v>(&self, vertices: &'v [Point]) -> AnimationBoxes<'v>
    where
        'a: 'v,
    {
        AnimationBoxes {
            animation: self.animation,
            vertices,
        }
    }

    /// Returns the positions, blended first if `vertices` is a pose.
    pub(super) fn positions<'v>(
        &self,
        vertices: &'v Vertices,
        blended: &'v mut Vec<Point>,
    ) -> Result<&'v [Point], KeyFrameError> {
        match vertices {
            Vertices::ReadBack(snapshot) => Ok(snapshot),
            Vertices::AtPose(pose) => {
                blend(&self.at(*pose)?, blended);
                Ok(blended)
            }
        }
    }
}

/// Returns the pose at `time`, interpolated or extrapolated from the times of two observed frames.
pub(crate) fn pose_between([first, second]: [f64; 2], time: f64) -> Pose {
    let alpha = ((time - first) / (second - first)) as f32;
    Pose {
        key: 0,
        // Both frames may have the same time.
        alpha: if alpha.is_finite() { alpha } else { 1.0 },
    }
}

/// Computes the positions of all vertices at a moment.
pub(super) fn blend(moment: &Moment<'_>, positions: &mut Vec<Point>) {
    let vertices = (0..moment.animation().vertex_count() as u32).into_par_iter();
    let all = vertices.with_min_len(RUN).map(|v| moment.vertex(v));
    all.collect_into_vec(positions);
}

/// Copies observed positions into the memory of an unused key frame, so that the backend gets its own memory back.
pub(super) fn store(seen: &Snapshot, frame: &mut KeyFrame) {
    let mut list = match Arc::get_mut(frame).map(take) {
        Some(PointBuffer::List(list)) => list,
        _ => Vec::new(),
    };
    let all = seen.par_iter().with_min_len(RUN);
    all.copied().collect_into_vec(&mut list);
    *frame = Arc::new(list.into());
}
