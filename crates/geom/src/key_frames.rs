//! All key frames of an animation: held in memory, paged during playback, or streamed by the caller.

use crate::key_window::KeyWindow;
use crate::streamed_keys::StreamedKeys;
use crate::{KeyFrame, KeyFrameError};
use std::sync::Arc;

#[derive(Clone, Debug)]
pub(crate) enum KeyFrames {
    /// At least one key frame.
    Held(Vec<KeyFrame>),
    Paged(Arc<KeyWindow>),
    Streamed(Arc<StreamedKeys>),
}

impl KeyFrames {
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Held(all) => all.len(),
            Self::Paged(window) => window.keys,
            Self::Streamed(keys) => keys.count(),
        }
    }

    /// Returns the first key frame, which is always in memory.
    pub(crate) fn first(&self) -> &KeyFrame {
        match self {
            Self::Held(all) => &all[0],
            Self::Paged(window) => &window.first,
            Self::Streamed(keys) => &keys.first,
        }
    }

    /// Returns a key frame. Blocks while it is read.
    pub(crate) fn get(&self, key: usize) -> Result<KeyFrame, KeyFrameError> {
        match self {
            Self::Held(all) => Ok(Arc::clone(&all[key])),
            Self::Paged(window) => window.get(key),
            Self::Streamed(keys) => Ok(keys.get(key)),
        }
    }

    /// Starts to read paged key frames in the given order.
    pub(crate) fn look_ahead(&self, keys: impl IntoIterator<Item = usize>) {
        if let Self::Paged(window) = self {
            window.look_ahead(keys);
        }
    }
}
