//! Moments of an animation, which blend two key frames, or show one if the blend weight is zero.

use crate::{Aabb, Animation, KeyFrame, KeyFrameError, Point, Pose, Triangle};
use std::sync::Arc;

/// Positions at one pose of an animation. Keeps its key frames alive.
#[derive(Clone, Debug)]
pub struct Moment<'a> {
    animation: &'a Animation,
    pose: Pose,
    earlier: KeyFrame,
    /// Has no effect if the blend weight is zero. [`Animation::moment`] then sets it to `earlier`.
    later: KeyFrame,
}

impl<'a> Moment<'a> {
    /// Creates the blend of two key frames at `pose`. A weight above 1 extrapolates.
    ///
    /// The key frames need not belong to the animation, but must have as many vertices.
    pub fn new(animation: &'a Animation, pose: Pose, [earlier, later]: [KeyFrame; 2]) -> Self {
        Self {
            animation,
            pose,
            earlier,
            later,
        }
    }

    /// Returns the animation.
    pub fn animation(&self) -> &'a Animation {
        self.animation
    }

    /// Returns the pose.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Returns the earlier and the later key frame. If the blend weight is zero, only the earlier one is read.
    pub fn key_frames(&self) -> [&[Point]; 2] {
        [&self.earlier, &self.later]
    }

    /// Returns the position of one vertex, with the same bits as on every backend.
    #[inline]
    pub fn vertex(&self, vertex: u32) -> Point {
        let v = vertex as usize;
        self.pose.blend(self.earlier[v], self.later[v])
    }

    /// Returns the corners of one triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.animation.triangles()[triangle as usize].map(|v| self.vertex(v))
    }

    /// Returns the [`Animation::build_box`] of one triangle at this pose.
    #[inline]
    pub fn build_box(&self, triangle: u32) -> Aabb {
        self.animation.box_of(&self.corners(triangle), triangle)
    }
}

impl Animation {
    /// Returns the positions at `pose`. Blocks while key frames are read.
    ///
    /// # Errors
    /// Those of [`Self::key`].
    pub fn moment(&self, pose: Pose) -> Result<Moment<'_>, KeyFrameError> {
        let earlier = self.key(pose.key as usize)?;
        let later = if pose.alpha == 0.0 {
            Arc::clone(&earlier)
        } else {
            self.key(pose.key as usize + 1)?
        };
        Ok(Moment::new(self, pose, [earlier, later]))
    }

    /// Returns the positions at `time`, measured in key frames. Blocks while key frames are read.
    ///
    /// # Errors
    /// Those of [`Self::key`].
    pub fn at(&self, time: f64) -> Result<Moment<'_>, KeyFrameError> {
        self.moment(self.pose(time))
    }
}
