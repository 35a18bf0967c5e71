//! Where positions lie.

use crate::Point;
use std::any::Any;
use std::fmt;
use std::ops::{Deref, DerefMut};

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

impl FromIterator<Point> for PointBuffer {
    fn from_iter<I: IntoIterator<Item = Point>>(points: I) -> Self {
        Self::List(points.into_iter().collect())
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
