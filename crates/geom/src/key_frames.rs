//! Key frames, either held in memory or read during playback, and moments, which blend two key frames.

use crate::key_window::KeyWindow;
use crate::live_keys::LiveKeys;
use crate::{Aabb, Animation, Point, Pose, Triangle};
use std::any::Any;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Host memory that a device reads directly, without a copy.
pub trait SharedMemory: DerefMut<Target = [Point]> + Any + Send + Sync {}

/// Positions in host memory.
pub enum PointBuffer {
    /// Memory that only the host reads.
    List(Vec<Point>),
    /// Memory that a device reads too.
    Shared(Box<dyn SharedMemory>),
}

impl PointBuffer {
    /// Returns the shared memory if its type is `M`.
    pub fn shared<M: SharedMemory>(&self) -> Option<&M> {
        match self {
            Self::List(_) => None,
            Self::Shared(memory) => (&**memory as &dyn Any).downcast_ref(),
        }
    }
}

impl Default for PointBuffer {
    fn default() -> Self {
        Self::List(Vec::new())
    }
}

impl From<Vec<Point>> for PointBuffer {
    fn from(list: Vec<Point>) -> Self {
        Self::List(list)
    }
}

impl Deref for PointBuffer {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        match self {
            Self::List(list) => list,
            Self::Shared(memory) => memory,
        }
    }
}

impl DerefMut for PointBuffer {
    fn deref_mut(&mut self) -> &mut [Point] {
        match self {
            Self::List(list) => list,
            Self::Shared(memory) => memory,
        }
    }
}

impl fmt::Debug for PointBuffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} points", self.len())
    }
}

/// One position per vertex, shared by all readers.
pub type KeyFrame = Arc<PointBuffer>;

/// Failure to read key frames or to create an animation from them.
///
/// One line that names the cause, and the file if there is one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct KeyFrameError(pub String);

/// Reads a key frame that is not in memory, counted from 0.
///
/// Returns one position per vertex, with the same bits on every call. Several threads may call it at the same time. It
/// fails if the key frame cannot be read, or changed since it was first read.
pub type KeySource = dyn Fn(usize) -> Result<Vec<Point>, KeyFrameError> + Send + Sync;

/// Reads a key frame. A panic of `source` is treated as an error; `source` must keep its own state consistent.
///
/// # Errors
/// The error of `source`, or its panic.
pub fn read_key(source: &KeySource, key: usize) -> Result<Vec<Point>, KeyFrameError> {
    let read = catch_unwind(AssertUnwindSafe(|| source(key)));
    let panicked = |_| {
        Err(KeyFrameError(format!(
            "key frame {key}: its reader panicked"
        )))
    };
    read.unwrap_or_else(panicked)
}

/// Checks that a key frame has as many vertices as the first.
pub(crate) fn check_key(key: usize, found: usize, first: usize) -> Result<(), KeyFrameError> {
    match found == first {
        true => Ok(()),
        false => Err(KeyFrameError(format!(
            "key frame {key} has {found} vertices, the first has {first}"
        ))),
    }
}

#[derive(Clone, Debug)]
pub(crate) enum KeyFrames {
    /// At least one key frame.
    Held(Vec<KeyFrame>),
    Streamed(Arc<KeyWindow>),
    Live(Arc<LiveKeys>),
}

/// Positions at one pose of an animation. Keeps its key frames alive.
#[derive(Clone, Debug)]
pub struct Moment<'a> {
    animation: &'a Animation,
    pose: Pose,
    earlier: KeyFrame,
    /// Same as `earlier` if the pose does not read the later key frame.
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

    /// Returns the two blended key frames. At a weight of 0 the later one is not read.
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
