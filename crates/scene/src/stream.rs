//! Key frames of any source as an animation: held in memory, or read while they are played.

use crate::{Options, Result, SceneError};
use geom::{Animation, KeyFrameError, Point};
use rayon::prelude::*;
use std::sync::Arc;

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

/// Key frames that are kept of a stream, at least and at most.
const WINDOW: [u64; 2] = [8, 64];

/// Bytes of a key frame of so many vertices.
pub(crate) fn bytes(vertices: usize) -> u64 {
    (vertices as u64).saturating_mul(size_of::<Point>() as u64)
}

/// Key frames that memory has to hold, of so many of so many vertices.
pub(crate) fn held(keys: usize, vertices: usize, options: &Options) -> usize {
    let most = options.key_bytes / bytes(vertices).max(1);
    match keys as u64 <= most {
        true => keys,
        false => keys.min((most / 2).clamp(WINDOW[0], WINDOW[1]) as usize),
    }
}

/// An animation over so many key frames of so many vertices.
pub(crate) fn animation(
    source: impl Fn(usize) -> Result<Vec<Point>, KeyFrameError> + Send + Sync + 'static,
    (keys, vertices): (usize, usize),
    triangles: Vec<[u32; 3]>,
    options: &Options,
) -> Result<Animation> {
    let window = held(keys, vertices, options);
    if window < keys {
        let source = Arc::new(source);
        return Ok(Animation::streamed(source, [keys, window], triangles)?);
    }
    let read = (0..keys).into_par_iter().map(source);
    // Collected before looked at, so that the first bad one is named whichever thread is faster.
    let read: Vec<_> = read.collect();
    let keys = read.into_iter().collect::<Result<_, _>>()?;
    Ok(Animation::new(keys, triangles)?)
}
