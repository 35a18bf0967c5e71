//! A window of key frames around the playback position, read on its own threads.

use crate::key_frame::{check_key, read_key};
use crate::{KeyFrame, KeyFrameError, KeySource, lock, parallelism};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// Number of key frames of the window that look-ahead leaves to other requests.
const SPARE: usize = 2;
/// Maximum number of key frames that look-ahead announces. An announcement takes quadratic time.
const MOST_AHEAD: usize = 128;

/// A window over a sequence of key frames, which follows playback.
///
/// Key frames are read in a separate thread pool. It has half as many threads as [`parallelism`], because trees are
/// built at the same time. The pool runs the [`KeySource`], which is code of the program and may call the library. In a
/// pool of [`crate::start_library_pool`], the parallel work of such a call would run in the same pool. While the call
/// waits, its thread could start another call of the [`KeySource`], which may need a lock that the first one holds. So
/// the pool is created directly: see module `threads`.
pub(crate) struct KeyWindow {
    /// Number of key frames in the whole sequence.
    pub(crate) keys: usize,
    pub(crate) capacity: usize,
    /// First key frame, held in addition to the window.
    pub(crate) first: KeyFrame,
    shared: Arc<SharedWindow>,
    pool: rayon::ThreadPool,
}

struct SharedWindow {
    source: Arc<KeySource>,
    state: Mutex<WindowState>,
    arrived: Condvar,
}

#[derive(Default)]
struct WindowState {
    entries: BTreeMap<usize, PagedKey>,
    /// Logical time. Increases with each lookup and each finished read.
    clock: u64,
    /// Key frames to be played, in order and without duplicates.
    upcoming: Vec<usize>,
}

/// A key frame in the window.
#[derive(Default)]
struct PagedKey {
    /// `None` while the key frame is read.
    read: Option<Result<KeyFrame, KeyFrameError>>,
    /// Value of [`WindowState::clock`] at the last use.
    used: u64,
}

impl KeyWindow {
    /// Creates a window of `capacity` key frames, but at least four.
    ///
    /// # Errors
    /// The system refuses to start threads.
    pub(crate) fn new(
        source: Arc<KeySource>,
        first: KeyFrame,
        keys: usize,
        capacity: usize,
    ) -> Result<Self, KeyFrameError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .thread_name(|i| format!("key frames {i}"))
            .num_threads(parallelism().div_ceil(2))
            .build()
            .map_err(|e| KeyFrameError(format!("cannot start reader threads: {e}")))?;
        let shared = SharedWindow {
            source,
            state: Mutex::default(),
            arrived: Condvar::new(),
        };
        Ok(Self {
            keys,
            capacity: capacity.max(2 * SPARE),
            first,
            shared: Arc::new(shared),
            pool,
        })
    }

    /// Returns a key frame, and blocks until it is read. A read that failed is retried on the next call.
    pub(crate) fn get(&self, key: usize) -> Result<KeyFrame, KeyFrameError> {
        let mut state = lock(&self.shared.state);
        loop {
            if let Some(found) = self.find(&mut state, key) {
                if found.is_err() {
                    state.entries.remove(&key);
                }
                return found;
            }
            self.read(&mut state, key);
            let waited = self.shared.arrived.wait(state);
            state = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Starts to read key frames in the given order, as far as the capacity allows. Ignores all after the first
    /// [`MOST_AHEAD`].
    pub(crate) fn look_ahead(&self, keys: impl IntoIterator<Item = usize>) {
        let mut upcoming = Vec::new();
        for key in keys {
            if upcoming.len() == self.capacity.min(MOST_AHEAD) {
                break;
            }
            if !upcoming.contains(&key) {
                upcoming.push(key);
            }
        }
        let mut state = lock(&self.shared.state);
        for &key in upcoming.iter().take(self.capacity - SPARE) {
            if self.find(&mut state, key).is_none() {
                self.read(&mut state, key);
            }
        }
        state.upcoming = upcoming;
    }

    /// Returns at most `most` of the key frames to be played, with their numbers. Stops before the first that is not
    /// read yet or could not be read.
    pub(crate) fn upcoming(&self, most: usize) -> Vec<(usize, KeyFrame)> {
        let mut state = lock(&self.shared.state);
        let keys: Vec<usize> = state.upcoming.iter().copied().take(most).collect();
        let loaded = |key| Some((key, self.find(&mut state, key)?.ok()?));
        keys.into_iter().map_while(loaded).collect()
    }

    /// Starts to read a key frame, unless a read has started already.
    fn read(&self, state: &mut WindowState, key: usize) {
        if state.entries.contains_key(&key) {
            return;
        }
        state.entries.insert(key, PagedKey::default());
        let (vertices, capacity) = (self.first.len(), self.capacity);
        let shared = Arc::clone(&self.shared);
        self.pool.spawn(move || {
            let read = read_key(&*shared.source, key).and_then(|frame| {
                check_key(key, frame.len(), vertices)?;
                Ok(Arc::new(frame.into()))
            });
            let mut state = lock(&shared.state);
            state.clock += 1;
            let (read, used) = (Some(read), state.clock);
            state.entries.insert(key, PagedKey { read, used });
            state.forget_beyond(capacity);
            drop(state);
            shared.arrived.notify_all();
        });
    }

    /// Returns the result of reading a key frame and marks it as used. Returns `None` if the read has not finished.
    fn find(&self, state: &mut WindowState, key: usize) -> Option<Result<KeyFrame, KeyFrameError>> {
        if key == 0 {
            return Some(Ok(Arc::clone(&self.first)));
        }
        state.clock += 1;
        let entry = state.entries.get_mut(&key)?;
        entry.used = state.clock;
        entry.read.clone()
    }
}

impl WindowState {
    /// Drops the least recently used key frames until at most `capacity` remain. Reads that are pending or failed do
    /// not count.
    fn forget_beyond(&mut self, capacity: usize) {
        let ready = |(&key, entry): (&usize, &PagedKey)| match &entry.read {
            Some(Ok(_)) => Some((entry.used, key)),
            _ => None,
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
        write!(f, "KeyWindow of {} key frames", self.keys)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const FEW: usize = 8;

    /// Returns a window over key frames of one vertex whose coordinates equal the key's number, and a counter of reads.
    /// Key frames from 90 on cannot be read.
    fn window() -> (Arc<AtomicUsize>, KeyWindow) {
        let reads = Arc::<AtomicUsize>::default();
        let counted = Arc::clone(&reads);
        let source = move |key| {
            counted.fetch_add(1, Ordering::Relaxed);
            match key {
                90.. => Err(KeyFrameError(format!("{key}.ply: gone"))),
                _ => Ok(vec![[key as f32; 3]]),
            }
        };
        let first = Arc::new(vec![[0.0; 3]].into());
        let window = KeyWindow::new(Arc::new(source), first, 100, FEW).unwrap();
        (reads, window)
    }

    #[test]
    fn reads_any_order_within_memory_limit() {
        let (_, window) = window();
        for key in (0..90).chain([3, 80, 0]) {
            assert_eq!(window.get(key).unwrap()[0][0], key as f32);
            assert!(lock(&window.shared.state).entries.len() <= FEW);
        }
        assert_eq!(window.get(95).unwrap_err().to_string(), "95.ply: gone");
    }

    #[test]
    fn prefetched_frames_are_read_once() {
        let (counter, window) = window();
        for key in 0..80 {
            window.look_ahead(key..key + 20);
            assert_eq!(window.get(key).unwrap()[0][0], key as f32);
            assert_eq!(window.upcoming(1)[0].0, key);
        }
        drop(window);
        let reads = counter.load(Ordering::Relaxed);
        assert!(reads <= 80 + FEW, "{reads}");
    }

    #[test]
    fn look_ahead_is_limited_in_large_windows() {
        let first = Arc::new(vec![[0.0; 3]].into());
        let window = KeyWindow::new(Arc::new(|_| Ok(vec![[0.0; 3]])), first, 999, 999).unwrap();
        window.look_ahead(1..999);
        assert_eq!(lock(&window.shared.state).upcoming.len(), MOST_AHEAD);
    }

    #[test]
    fn panicking_reader_returns_an_error() {
        let first = Arc::new(vec![[0.0; 3]].into());
        let window = KeyWindow::new(Arc::new(|_| panic!("mine")), first, 9, FEW).unwrap();
        let said = window.get(3).unwrap_err().to_string();
        assert_eq!(said, "key frame 3: its reader panicked");
    }

    #[test]
    fn first_key_frame_is_never_reread() {
        let (counter, window) = window();
        window.look_ahead([0]);
        assert_eq!(window.upcoming(1)[0].0, 0);
        assert_eq!(window.get(0).unwrap()[0], [0.0; 3]);
        drop(window);
        assert_eq!(counter.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn threads_share_one_key_frame_read() {
        let (counter, window) = window();
        std::thread::scope(|s| {
            let all: Vec<_> = (0..8).map(|_| s.spawn(|| window.get(7).unwrap())).collect();
            let all = all.into_iter().map(|thread| thread.join().unwrap());
            assert!(all.into_iter().all(|frame| frame[0] == [7.0; 3]));
        });
        assert_eq!(counter.load(Ordering::Relaxed), 1);
    }
}
