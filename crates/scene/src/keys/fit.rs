//! Errors of blended frames: bounds on intervals during the search, and an independent measurement of all frames
//! afterwards. The measurement blends each frame as a renderer would.

use geom::{KeyFrame, Point, Pose};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Vertices per block. Two kept frames and one frame between them fit the first-level cache.
const BLOCK: usize = 512;

/// Returns the squared distance. It is 0 if both points are not finite, and infinite if only one is not.
#[inline]
fn square(found: Point, wanted: Point) -> f64 {
    let way: [f64; 3] = std::array::from_fn(|i| f64::from(found[i]) - f64::from(wanted[i]));
    let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    // Squared differences of f32 never overflow f64, so only non-finite points get here.
    if square.is_finite() {
        return square;
    }
    let finite = |p: Point| p.iter().all(|x| x.is_finite());
    if finite(found) || finite(wanted) {
        f64::INFINITY
    } else {
        0.0
    }
}

/// Largest squared error of an interval, or a lower bound as `Err`.
type IntervalError = Result<f64, f64>;

/// Finds the smallest sets of key frames for one animation. Results for one tolerance are reused for the next.
///
/// Start with loose tolerances for the least work: intervals that exceed them are not examined again.
#[derive(Debug)]
pub struct Reducer<'a> {
    keys: &'a [KeyFrame],
    /// Blocks with moving vertices. In all other blocks, every blend equals the frame.
    pub(super) blocks: Vec<Range<usize>>,
    /// Errors of all intervals, indexed by `from * frames + to`. They are measured on demand and only as far as needed.
    /// The diagonal holds the errors of single frames.
    known: Vec<IntervalError>,
    /// Block that last exceeded a limit. It is examined first, because it probably exceeds the next one too.
    suspect: AtomicUsize,
}

impl<'a> Reducer<'a> {
    /// Creates a reducer for all key frames of an animation. `keys` is not empty.
    #[must_use]
    pub fn new(keys: &'a [KeyFrame]) -> Self {
        let (frames, vertices) = (keys.len(), keys[0].len());
        let blocks = (0..vertices.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| b * BLOCK..vertices.min((b + 1) * BLOCK))
            .filter(|block| moves(keys, block))
            .collect();
        Self {
            keys,
            blocks,
            known: vec![Err(0.0); frames * frames],
            suspect: AtomicUsize::new(0),
        }
    }

    pub(super) fn frames(&self) -> usize {
        self.keys.len()
    }

    /// Returns the largest squared error of the frames between `from` and `to`. If both are equal, returns the error of
    /// that frame as a replacement for all frames. Returns `None` if the error exceeds `limit`.
    pub(super) fn within(&mut self, [from, to]: [usize; 2], limit: f64) -> Option<f64> {
        let place = from * self.frames() + to;
        self.known[place] = match self.known[place] {
            Err(least) if least <= limit => self.measure([from, to], limit),
            known => known,
        };
        self.known[place].ok().filter(|&square| square <= limit)
    }

    /// Measures all blocks, the last suspect first, until one exceeds the limit.
    fn measure(&self, [from, to]: [usize; 2], limit: f64) -> IntervalError {
        let frames = if from == to {
            0..self.frames()
        } else {
            from + 1..to
        };
        let examine = |index: usize| {
            let off = |frame| off(self.keys, [from, to, frame], &self.blocks[index]);
            let worst = worst_of(frames.clone(), limit, off);
            if worst <= limit {
                return Ok(worst);
            }
            self.suspect.store(index, Ordering::Relaxed);
            Err(worst)
        };
        let suspect = self.suspect.load(Ordering::Relaxed);
        if suspect < self.blocks.len() {
            examine(suspect)?;
        }
        let all = (0..self.blocks.len()).into_par_iter().map(examine);
        all.try_reduce(|| 0.0, |a, b| Ok(a.max(b)))
    }
}

/// Returns the largest error of all frames, from the middle outwards. Stops at the first one above `limit`.
fn worst_of(frames: Range<usize>, limit: f64, off: impl Fn(usize) -> f64) -> f64 {
    let middle = frames.start.midpoint(frames.end);
    let mut worst: f64 = 0.0;
    for frame in (middle..frames.end).chain((frames.start..middle).rev()) {
        worst = worst.max(off(frame));
        if worst > limit {
            break;
        }
    }
    worst
}

/// Returns the largest squared error of a block at one frame, which is blended from `from` and `to` by its time.
fn off(keys: &[KeyFrame], [from, to, frame]: [usize; 3], block: &Range<usize>) -> f64 {
    let [a, b, wanted] = [from, to, frame].map(|key| &keys[key][block.clone()]);
    let alpha = if from == to {
        0.0
    } else {
        ((frame - from) as f64 / (to - from) as f64) as f32
    };
    let pose = Pose { key: 0, alpha };
    let ends = a.iter().zip(b).zip(wanted);
    ends.fold(0.0, |worst, ((&a, &b), &wanted)| {
        worst.max(square(pose.blend(a, b), wanted))
    })
}

fn moves(keys: &[KeyFrame], block: &Range<usize>) -> bool {
    let bits = |p: &Point| p.map(f32::to_bits);
    let first = &keys[0][block.clone()];
    keys[1..].iter().any(|key| {
        let here = key[block.clone()].iter();
        here.zip(first).any(|(a, b)| bits(a) != bits(b))
    })
}

/// Error of the kept frames' motion against the original, over all original frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReductionError {
    /// Largest distance, in scene units. Infinite if a vertex is finite in only one of the motions.
    pub max_error: f64,
    /// First original frame with that distance, and the first such vertex in it. `None` if the distance is 0.
    pub worst: Option<(usize, usize)>,
    /// Root mean square distance over all frames and their finite vertices.
    pub rms: f64,
}

/// Measures the error of `kept` against all of `keys`.
///
/// # Panics
/// If `kept` is neither a single frame nor an ascending list that includes the first and the last frame of `keys`.
#[must_use]
pub fn measure(keys: &[KeyFrame], kept: &[usize]) -> ReductionError {
    let ascending = kept.windows(2).all(|w| w[0] < w[1]);
    let ends = (kept.first(), kept.last());
    assert!(
        ascending && (kept.len() == 1 || ends == (Some(&0), Some(&(keys.len() - 1)))),
        "kept frames ascend from the first to the last"
    );
    let times: Vec<f64> = kept.iter().map(|&k| k as f64).collect();
    let frames = (0..keys.len()).into_par_iter();
    let errors = frames.map(|frame| {
        let pose = Pose::among(frame as f64, &times);
        let from = &keys[kept[pose.key as usize]];
        // At weight 0 the later frame is not used.
        let to = kept.get(pose.key as usize + 1).map_or(from, |&k| &keys[k]);
        FrameError::of(&keys[frame], |v| pose.blend(from[v], to[v]))
    });
    let errors: Vec<_> = errors.collect();
    let mut fit = ReductionError {
        max_error: 0.0,
        worst: None,
        rms: 0.0,
    };
    // Sums in frame order, so that the result does not depend on the number of threads.
    let (mut sum, mut finite) = (0.0, 0);
    for (frame, error) in errors.into_iter().enumerate() {
        sum += error.sum;
        finite += error.finite;
        if error.worst.sqrt() > fit.max_error {
            fit.max_error = error.worst.sqrt();
            fit.worst = Some((frame, error.worst_vertex));
        }
    }
    fit.rms = (sum / finite.max(1) as f64).sqrt();
    fit
}

/// Error of one blended frame.
#[derive(Default)]
struct FrameError {
    /// Largest squared error, and its first vertex.
    worst: f64,
    worst_vertex: usize,
    /// Sum of squared errors.
    sum: f64,
    /// Number of vertices that should be finite.
    finite: usize,
}

impl FrameError {
    fn of(wanted: &[Point], blended: impl Fn(usize) -> Point) -> Self {
        let mut error = Self::default();
        for (vertex, &wanted) in wanted.iter().enumerate() {
            let square = square(blended(vertex), wanted);
            if square > error.worst {
                (error.worst, error.worst_vertex) = (square, vertex);
            }
            error.sum += square;
            error.finite += usize::from(wanted.iter().all(|x| x.is_finite()));
        }
        error
    }
}
