//! Animations from any source of key frames, held in memory or paged, and checks of the memory that they need.

use crate::{Result, SceneError, SceneOptions};
use geom::{Animation, KeyFrameError, Point, lock};
use rayon::prelude::*;
use std::path::Path;
use std::sync::{Arc, Mutex};

impl From<SceneError> for KeyFrameError {
    fn from(e: SceneError) -> Self {
        Self(e.0)
    }
}

impl From<KeyFrameError> for SceneError {
    fn from(e: KeyFrameError) -> Self {
        Self(e.0)
    }
}

/// Minimum and maximum number of key frames that a paged animation keeps in memory, in addition to the first.
const HELD_KEYS: [u64; 2] = [8, 64];

/// Numbers of key frames and of vertices in each.
#[derive(Clone, Copy)]
pub(crate) struct KeySize {
    pub(crate) keys: usize,
    pub(crate) vertices: usize,
}

impl KeySize {
    /// Returns the size of one key frame in bytes.
    fn key_bytes(&self) -> u64 {
        (self.vertices as u64).saturating_mul(size_of::<Point>() as u64)
    }

    /// Returns the number of key frames held in memory: all, if the animation is not paged. Otherwise those in addition
    /// to the first, which always stays in memory.
    fn held(&self, options: &SceneOptions) -> usize {
        let most = options.key_bytes / self.key_bytes().max(1);
        if self.keys as u64 <= most {
            return self.keys;
        }
        let held = (most / 2).clamp(HELD_KEYS[0], HELD_KEYS[1]);
        self.keys.min(held as usize)
    }
}

/// Creates an animation of this size from a source of key frames. If the `first` key frame is given, the first request
/// for it returns it without calling the source.
pub(crate) fn animation(
    source: impl Fn(usize) -> Result<Vec<Point>, KeyFrameError> + Send + Sync + 'static,
    first: Option<Vec<Point>>,
    size: KeySize,
    triangles: Vec<[u32; 3]>,
    options: &SceneOptions,
) -> Result<Animation> {
    let first = Mutex::new(first);
    let source = move |key: usize| {
        // The lock is released at the end of this statement, so that key frames are read in parallel.
        let first = lock(&first).take_if(|_| key == 0);
        first.map_or_else(|| source(key), Ok)
    };
    let (keys, held) = (size.keys, size.held(options));
    if held < keys {
        let source = Arc::new(source);
        return Ok(Animation::paged(source, keys, held, triangles)?);
    }
    let read = (0..keys).into_par_iter().map(source);
    // Collects all results before checking them. Otherwise the reported key frame would depend on thread timing.
    let read: Vec<_> = read.collect();
    let keys = read.into_iter().collect::<Result<_, _>>()?;
    Ok(Animation::new(keys, triangles)?)
}

pub(crate) fn within(path: &Path, what: &str, found: usize, limit: usize) -> Result<()> {
    if found <= limit {
        return Ok(());
    }
    let cause = format!("{found} {what} are more than the limit of {limit}");
    Err(SceneError::unusable(path, cause))
}

/// Refuses scenes without triangles, and scenes with too many vertices or triangles. `hint` is appended to the message
/// "no triangles".
pub(crate) fn check_counts(
    path: &Path,
    [vertices, triangles]: [usize; 2],
    hint: &str,
) -> Result<()> {
    within(path, "vertices", vertices, u32::MAX as usize)?;
    within(path, "triangles", triangles, Animation::MAX_TRIANGLES)?;
    if triangles == 0 {
        return Err(SceneError::unusable(path, format!("no triangles{hint}")));
    }
    Ok(())
}

/// Refuses an animation if too little memory is free, before its key frames are allocated. Counts the key frames that
/// are held at once and the memory that the caller needs.
pub(crate) fn check_keys(
    place: impl AsRef<Path>,
    size: KeySize,
    triangles: usize,
    options: &SceneOptions,
) -> Result<()> {
    let KeySize { keys, vertices } = size;
    let held = size.held(options);
    // The first key frame of a paged animation stays in memory.
    let kept = if held == keys { held } else { held + 1 };
    let bytes = (kept as u64).saturating_mul(size.key_bytes());
    let plural = if keys == 1 { "" } else { "s" };
    let share = if held == keys {
        String::new()
    } else {
        format!("{held} of ")
    };
    let mut what = format!("{share}{keys} key frame{plural} of {vertices} vertices");
    if options.triangle_bytes > 0 {
        what += &format!(", and trees over {triangles} triangles");
    }
    check_memory(place, what, with_more(bytes, triangles, options))
}

/// Returns the bytes of a scene plus the memory that the caller needs for it.
pub(crate) fn with_more(bytes: u64, triangles: usize, options: &SceneOptions) -> u64 {
    (triangles as u64)
        .saturating_mul(options.triangle_bytes)
        .saturating_add(options.more_bytes)
        .saturating_add(bytes)
}

/// Refuses to use `bytes` of memory if they are not free. `what` names their use.
pub(crate) fn check_memory(place: impl AsRef<Path>, what: String, bytes: u64) -> Result<()> {
    let checked = host::check_memory(bytes);
    checked.map_err(|e| SceneError::unusable(place, format_args!("{what}: {e}")))
}

/// Ensures that `more` elements can be added to a list.
pub(crate) fn reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), String> {
    host::reserve(list, more).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::refused;

    #[test]
    fn rejects_counts_beyond_the_limit() {
        let limit = Animation::MAX_TRIANGLES;
        let within = |found| within(Path::new("a.ply"), "triangles", found, limit);
        refused(within(limit + 1), &["1073741825", "1073741824"]);
        assert!(within(limit).is_ok());
    }
}
