//! An animation at one pose, with the key frames that it blends.

use crate::{Aabb, Animation, KeyFrame, Point, Pose, Triangle};

/// One moment. It keeps its key frames alive.
#[derive(Clone, Debug)]
pub struct Moment<'a> {
    animation: &'a Animation,
    pose: Pose,
    earlier: KeyFrame,
    /// The earlier one where it is not read.
    later: KeyFrame,
}

impl<'a> Moment<'a> {
    pub(crate) fn new(
        animation: &'a Animation,
        pose: Pose,
        [earlier, later]: [KeyFrame; 2],
    ) -> Self {
        Self {
            animation,
            pose,
            earlier,
            later,
        }
    }

    /// The animation.
    pub fn animation(&self) -> &'a Animation {
        self.animation
    }

    /// Where it stands.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The key frames that are blended. At a weight of 0 the later one is not read.
    pub fn key_frames(&self) -> [&[Point]; 2] {
        [&self.earlier, &self.later]
    }

    /// One vertex: the same bits as every backend's.
    #[inline]
    pub fn vertex(&self, vertex: u32) -> Point {
        let v = vertex as usize;
        self.pose.blend(self.earlier[v], self.later[v])
    }

    /// One triangle's corners.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Triangle {
        self.animation.triangles()[triangle as usize].map(|v| self.vertex(v))
    }

    /// [`Animation::build_box`] of what is blended here.
    #[inline]
    pub fn build_box(&self, triangle: u32) -> Aabb {
        self.animation.box_of(&self.corners(triangle), triangle)
    }
}
