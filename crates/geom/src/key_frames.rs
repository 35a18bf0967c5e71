//! Key frames: all of them held in memory, or read while they are played.

use crate::Point;
use crate::key_window::KeyWindow;
use std::sync::Arc;

/// One position a vertex, shared by all who read it.
pub type KeyFrame = Arc<Vec<Point>>;

/// Why a key frame cannot be had: one line that names the file and the cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct KeyFrameError(pub String);

/// Where key frames come from that are not held.
pub trait KeySource: Send + Sync {
    /// How many there are: one at least.
    fn key_count(&self) -> usize;

    /// Vertices in each.
    fn vertex_count(&self) -> usize;

    /// One position a vertex of a key frame, counted from 0: the same bits each time. Several threads ask at a time.
    ///
    /// # Errors
    /// The key frame cannot be read, or is no longer what it was.
    fn read(&self, key: usize) -> Result<Vec<Point>, KeyFrameError>;
}

#[derive(Clone, Debug)]
pub(crate) enum KeyFrames {
    Held(Vec<KeyFrame>),
    Streamed(Arc<KeyWindow>),
}

impl KeyFrames {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Held(all) => all.len(),
            Self::Streamed(window) => window.key_count(),
        }
    }

    pub(crate) fn get(&self, key: usize) -> Result<KeyFrame, KeyFrameError> {
        match self {
            Self::Held(all) => Ok(Arc::clone(&all[key])),
            Self::Streamed(window) => window.get(key),
        }
    }
    /// Shows all key frames but the first, in their order. Several are read at a time.
    pub(crate) fn for_each_after_first(
        &self,
        mut see: impl FnMut(&[Point]),
    ) -> Result<(), KeyFrameError> {
        match self {
            Self::Held(all) => all[1..].iter().for_each(|frame| see(frame)),
            Self::Streamed(window) => {
                for key in 1..self.len() {
                    window.look_ahead((key..self.len().min(key + window.capacity())).collect());
                    see(&window.get(key)?);
                }
            }
        }
        Ok(())
    }
}
