//! Key frames, all of them held in memory or read while they are played; and moments, which blend two.

use crate::key_window::KeyWindow;
use crate::live_keys::LiveKeys;
use crate::{Aabb, Animation, Point, Pose, Triangle};
use std::any::Any;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Memory of the host that a device reads by itself, so that nothing is copied for it.
pub trait SharedMemory: DerefMut<Target = [Point]> + Any + Send + Sync {}

/// Positions in memory of the host.
pub enum PointBuffer {
    /// Nobody else reads it.
    List(Vec<Point>),
    /// A device does, too.
    Shared(Box<dyn SharedMemory>),
}

impl PointBuffer {
    /// The memory, if it is of that kind.
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

/// One position a vertex, shared by all who read it.
pub type KeyFrame = Arc<PointBuffer>;

/// Why key frames cannot be had, or do not make an animation: one line that names the cause, and the file if there is one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct KeyFrameError(pub String);

/// Reads a key frame that is not held, counted from 0: one position a vertex, the same bits each time. Several threads ask at
/// a time. An error says that it cannot be read, or is no longer what it was.
pub type KeySource = dyn Fn(usize) -> Result<Vec<Point>, KeyFrameError> + Send + Sync;

/// Reads a key frame. A reader that panics is one that fails: what it leaves behind is its own concern.
///
/// # Errors
/// The reader's.
pub fn read_key(source: &KeySource, key: usize) -> Result<Vec<Point>, KeyFrameError> {
    let read = catch_unwind(AssertUnwindSafe(|| source(key)));
    let panicked = |_| {
        Err(KeyFrameError(format!(
            "key frame {key}: its reader panicked"
        )))
    };
    read.unwrap_or_else(panicked)
}

/// All key frames have as many vertices as the first.
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
    /// One at least.
    Held(Vec<KeyFrame>),
    Streamed(Arc<KeyWindow>),
    Live(Arc<LiveKeys>),
}

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
    /// What stands between two frames or beyond them, by the pose's weight alone. They need not be the animation's own, but
    /// have as many vertices.
    pub fn new(animation: &'a Animation, pose: Pose, [earlier, later]: [KeyFrame; 2]) -> Self {
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
