//! Key frames that the caller pushes during playback.

use crate::{CoordinateRange, KeyFrame, PointBuffer, lock};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

#[derive(Debug)]
pub(crate) struct StreamedKeys {
    pub(crate) first: KeyFrame,
    state: Mutex<Recent>,
}

#[derive(Debug, Default)]
struct Recent {
    /// Number of the newest key frame.
    last: usize,
    /// The most recent key frames, oldest first, without key frame 0.
    kept: VecDeque<StreamedKey>,
    /// Buffers for reuse: dropped key frames, which readers may still hold, and frames added by
    /// [`StreamedKeys::add_spare`].
    spares: Vec<KeyFrame>,
}

#[derive(Debug)]
struct StreamedKey {
    frame: KeyFrame,
    /// Range of the coordinates; `None` until it is computed.
    range: Option<CoordinateRange>,
}

impl StreamedKeys {
    /// Number of recent key frames that are kept.
    pub(crate) const KEPT: usize = 4;

    pub(crate) fn new(first: KeyFrame) -> Self {
        Self {
            first,
            state: Mutex::default(),
        }
    }

    pub(crate) fn count(&self) -> usize {
        lock(&self.state).last + 1
    }

    /// Appends the next key frame and returns its number.
    pub(crate) fn push(&self, frame: KeyFrame) -> usize {
        let mut state = lock(&self.state);
        state.last += 1;
        state.kept.push_back(StreamedKey { frame, range: None });
        if state.kept.len() > Self::KEPT {
            let oldest = state.kept.pop_front();
            state.spares.extend(oldest.map(|key| key.frame));
        }
        state.last
    }

    pub(crate) fn add_spare(&self, frame: PointBuffer) {
        lock(&self.state).spares.push(Arc::new(frame));
    }

    pub(crate) fn spare(&self) -> Option<PointBuffer> {
        let spares = &mut lock(&self.state).spares;
        let is_free = |frame: &KeyFrame| Arc::strong_count(frame) == 1;
        let free = spares.iter().position(is_free)?;
        Arc::into_inner(spares.swap_remove(free))
    }

    /// Returns a key frame, or the oldest that is kept if `key` was dropped. Callers request key frames before they are
    /// dropped.
    pub(crate) fn get(&self, key: usize) -> KeyFrame {
        let found = lock(&self.state)
            .find(key)
            .map(|key| Arc::clone(&key.frame));
        found.unwrap_or_else(|| Arc::clone(&self.first))
    }

    /// Returns the range of coordinates of a key frame that was pushed, if it was computed before.
    pub(crate) fn known_range(&self, key: usize) -> Option<CoordinateRange> {
        lock(&self.state).find(key)?.range
    }

    /// Returns the range of coordinates of a key frame, and computes it by `range_of` if necessary.
    pub(crate) fn range(
        &self,
        key: usize,
        range_of: impl FnOnce(&KeyFrame) -> CoordinateRange,
    ) -> CoordinateRange {
        self.known_range(key).unwrap_or_else(|| {
            let range = range_of(&self.get(key));
            let mut state = lock(&self.state);
            // The range of a dropped key frame is not stored, because `find` returns another one.
            if key + state.kept.len() > state.last
                && let Some(found) = state.find(key)
            {
                found.range = Some(range);
            }
            range
        })
    }
}

impl Recent {
    /// Returns a key frame, as [`StreamedKeys::get`] does. Returns `None` for key frame 0 and before the first push.
    fn find(&mut self, key: usize) -> Option<&mut StreamedKey> {
        let back = self.last.saturating_sub(key);
        let at = self.kept.len().saturating_sub(back + 1);
        self.kept.get_mut(at).filter(|_| key > 0)
    }
}
