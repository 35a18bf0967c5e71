//! One key frame: its memory, its source, and the errors of both.

use crate::Point;
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
/// The message is one line. It names the cause, and the file if there is one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct KeyFrameError(pub String);

/// Function that reads the key frame with a given index.
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
    if found == first {
        return Ok(());
    }
    Err(KeyFrameError(format!(
        "key frame {key} has {found} vertices, the first has {first}"
    )))
}
