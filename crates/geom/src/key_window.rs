//! The key frames that are wanted now or soon, read on threads of their own.

use crate::{KeyFrame, KeyFrameError, KeySource, Point};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Key frames that others may take while those to come are read.
const SPARE: usize = 2;

/// A part of a sequence of key frames, which follows whoever plays it.
///
/// Readers have a pool of their own, half as large as the caller's, for trees are built meanwhile.
/// One of them never waits for work that waits for a key frame, so none waits for ever.
pub(crate) struct KeyWindow {
    shared: Arc<Shared>,
    pool: rayon::ThreadPool,
}

struct Shared {
    source: Arc<dyn KeySource>,
    /// Always held, beside the others.
    first: KeyFrame,
    capacity: usize,
    state: Mutex<State>,
    arrived: Condvar,
}

#[derive(Default)]
struct State {
    entries: BTreeMap<usize, Entry>,
    /// Rises with each use.
    clock: u64,
    /// Key frames to come, the next one first and none twice.
    upcoming: Vec<usize>,
}

enum Entry {
    Reading,
    Ready { frame: KeyFrame, used: u64 },
    Failed(KeyFrameError),
}

impl KeyWindow {
    /// Of so many key frames, at least four.
    ///
    /// # Errors
    /// No threads can be had.
    pub(crate) fn new(
        source: Arc<dyn KeySource>,
        first: KeyFrame,
        capacity: usize,
    ) -> Result<Self, KeyFrameError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .thread_name(|i| format!("key frames {i}"))
            .num_threads(rayon::current_num_threads().div_ceil(2))
            .build()
            .map_err(|e| KeyFrameError(format!("no threads to read key frames: {e}")))?;
        let shared = Shared {
            source,
            first,
            capacity: capacity.max(2 * SPARE),
            state: Mutex::default(),
            arrived: Condvar::new(),
        };
        Ok(Self {
            shared: Arc::new(shared),
            pool,
        })
    }

    pub(crate) fn key_count(&self) -> usize {
        self.shared.source.key_count()
    }

    pub(crate) fn capacity(&self) -> usize {
        self.shared.capacity
    }

    pub(crate) fn first(&self) -> &KeyFrame {
        &self.shared.first
    }

    /// Waits for a key frame.
    pub(crate) fn get(&self, key: usize) -> Result<KeyFrame, KeyFrameError> {
        let mut state = self.shared.lock();
        loop {
            if let Some(found) = self.shared.take(&mut state, key) {
                return found;
            }
            if self.is_new(&mut state, key) {
                self.read(key);
            }
            let waited = self.shared.arrived.wait(state);
            state = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Has key frames be read, the first one first, as far as there is room for them.
    pub(crate) fn look_ahead(&self, keys: impl IntoIterator<Item = usize>) {
        let capacity = self.shared.capacity;
        let mut upcoming = Vec::with_capacity(capacity);
        for key in keys {
            if upcoming.len() == capacity {
                break;
            }
            if !upcoming.contains(&key) {
                upcoming.push(key);
            }
        }
        let mut state = self.shared.lock();
        for &key in upcoming.iter().take(capacity - SPARE) {
            if self.shared.take(&mut state, key).is_none() && self.is_new(&mut state, key) {
                self.read(key);
            }
        }
        state.upcoming = upcoming;
    }

    /// The first `most` key frames to come, with their numbers, as far as they are there.
    pub(crate) fn upcoming(&self, most: usize) -> Vec<(usize, KeyFrame)> {
        let mut state = self.shared.lock();
        let keys: Vec<usize> = state.upcoming.iter().copied().take(most).collect();
        let there = |key| Some((key, self.shared.take(&mut state, key)?.ok()?));
        keys.into_iter().map_while(there).collect()
    }

    /// Whether nobody reads this key frame yet; somebody has to, from now on.
    fn is_new(&self, state: &mut State, key: usize) -> bool {
        let is_new = !state.entries.contains_key(&key);
        if is_new {
            state.entries.insert(key, Entry::Reading);
        }
        is_new
    }

    fn read(&self, key: usize) {
        let shared = Arc::clone(&self.shared);
        self.pool.spawn(move || {
            let read = shared.source.read(key);
            shared.file(key, read);
        });
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What came of reading a key frame; nothing if it is not there yet.
    fn take(&self, state: &mut State, key: usize) -> Option<Result<KeyFrame, KeyFrameError>> {
        match key {
            0 => Some(Ok(Arc::clone(&self.first))),
            key => state.take(key),
        }
    }

    fn file(&self, key: usize, read: Result<Vec<Point>, KeyFrameError>) {
        let mut state = self.lock();
        state.clock += 1;
        let entry = match read {
            Ok(points) => Entry::Ready {
                frame: Arc::new(points),
                used: state.clock,
            },
            Err(why) => Entry::Failed(why),
        };
        state.entries.insert(key, entry);
        state.forget_beyond(self.capacity);
        drop(state);
        self.arrived.notify_all();
    }
}

impl State {
    fn take(&mut self, key: usize) -> Option<Result<KeyFrame, KeyFrameError>> {
        self.clock += 1;
        match self.entries.get_mut(&key)? {
            Entry::Reading => None,
            Entry::Ready { frame, used } => {
                *used = self.clock;
                Some(Ok(Arc::clone(frame)))
            }
            Entry::Failed(why) => Some(Err(why.clone())),
        }
    }

    /// Drops what was used longest ago.
    fn forget_beyond(&mut self, capacity: usize) {
        let ready = |(&key, entry): (&usize, &Entry)| match entry {
            Entry::Ready { used, .. } => Some((*used, key)),
            Entry::Reading | Entry::Failed(_) => None,
        };
        let mut all: Vec<_> = self.entries.iter().filter_map(ready).collect();
        all.sort_unstable();
        for (_, key) in &all[..all.len().saturating_sub(capacity)] {
            self.entries.remove(key);
        }
    }
}

impl fmt::Debug for KeyWindow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "KeyWindow of {} key frames", self.key_count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const FEW: usize = 8;

    /// Key frames of one vertex that stands at the key's number; those from 90 on cannot be read.
    #[derive(Default)]
    struct Numbers(AtomicUsize);

    impl KeySource for Numbers {
        fn key_count(&self) -> usize {
            100
        }

        fn vertex_count(&self) -> usize {
            1
        }

        fn read(&self, key: usize) -> Result<Vec<Point>, KeyFrameError> {
            self.0.fetch_add(1, Ordering::Relaxed);
            match key {
                90.. => Err(KeyFrameError(format!("{key}.ply: gone"))),
                _ => Ok(vec![[key as f32; 3]]),
            }
        }
    }

    fn window() -> (Arc<Numbers>, KeyWindow) {
        let source = Arc::<Numbers>::default();
        let first = Arc::new(vec![[0.0; 3]]);
        let window = KeyWindow::new(Arc::clone(&source) as _, first, FEW).unwrap();
        (source, window)
    }

    #[test]
    fn every_key_frame_can_be_had_in_any_order_and_few_are_kept() {
        let (_, window) = window();
        for key in (0..90).chain([3, 80, 0]) {
            assert_eq!(window.get(key).unwrap()[0][0], key as f32);
            assert!(window.shared.lock().entries.len() <= FEW);
        }
        assert_eq!(window.get(95).unwrap_err().to_string(), "95.ply: gone");
    }

    #[test]
    fn what_is_to_come_is_read_once_and_still_there_when_it_comes() {
        let (source, window) = window();
        for key in 0..80 {
            window.look_ahead(key..key + 20);
            assert_eq!(window.get(key).unwrap()[0][0], key as f32);
            assert_eq!(window.upcoming(1)[0].0, key);
        }
        drop(window);
        let reads = source.0.load(Ordering::Relaxed);
        assert!(reads <= 80 + FEW, "{reads}");
    }

    #[test]
    fn the_first_key_frame_is_never_read_again() {
        let (source, window) = window();
        window.look_ahead([0]);
        assert_eq!(window.upcoming(1)[0].0, 0);
        assert_eq!(window.get(0).unwrap()[0], [0.0; 3]);
        drop(window);
        assert_eq!(source.0.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn many_threads_may_wait_for_one_key_frame() {
        let (source, window) = window();
        std::thread::scope(|s| {
            let all: Vec<_> = (0..8).map(|_| s.spawn(|| window.get(7).unwrap())).collect();
            let all = all.into_iter().map(|thread| thread.join().unwrap());
            assert!(all.into_iter().all(|frame| frame[0] == [7.0; 3]));
        });
        assert_eq!(source.0.load(Ordering::Relaxed), 1);
    }
}
