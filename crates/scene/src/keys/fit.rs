//! How far off frames are that are not kept: of intervals while frames are chosen, and of all frames afterwards, afresh,
//! frame by frame, as a renderer would play them.

use geom::{KeyFrame, Point, Pose};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Vertices looked at together: two kept frames and one between them fit the first cache.
const BLOCK: usize = 512;

/// The square of the distance; 0 where both are not finite, infinite where one is.
#[inline]
fn square(found: Point, wanted: Point) -> f64 {
    let way: [f64; 3] = std::array::from_fn(|i| f64::from(found[i]) - f64::from(wanted[i]));
    let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    // Squares of f32 never overflow f64, so only points that are not finite get here.
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

/// The largest square of an interval, or, where that is not known, what it is at least.
type Known = Result<f64, f64>;

/// Finds sets of frames for one animation; what it learns at one tolerance serves the next.
///
/// Work is least if loose tolerances come first: what was found too far apart for those is never looked at again.
#[derive(Debug)]
pub struct Reducer<'a> {
    keys: &'a [KeyFrame],
    /// Blocks in which some vertex moves: in the others every blend is the frame itself.
    blocks: Vec<Range<usize>>,
    /// Of all intervals, by `from * frames + to`, measured when asked for and no further than needed; frames alone are on
    /// the diagonal.
    known: Vec<Known>,
    /// The block that was last found too far off: likely so for the next interval, too.
    suspect: AtomicUsize,
}

impl<'a> Reducer<'a> {
    /// For all key frames of an animation, one at least.
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

    /// The largest square over all frames between `from` and `to`, or over all frames if they are one that stands for each;
    /// nothing if it is more than `limit`.
    pub(super) fn within(&mut self, [from, to]: [usize; 2], limit: f64) -> Option<f64> {
        let place = from * self.frames() + to;
        self.known[place] = match self.known[place] {
            Err(least) if least <= limit => self.look([from, to], limit),
            known => known,
        };
        self.known[place].ok().filter(|&square| square <= limit)
    }

    /// Looks at every block, the last suspect first, until one is too far off.
    fn look(&self, [from, to]: [usize; 2], limit: f64) -> Known {
        let frames = match from == to {
            true => 0..self.frames(),
            false => from + 1..to,
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

/// The largest of all frames, from the middle outwards; the first that is more than `limit` ends it.
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

/// The largest square in a block at one frame, at the weight that its time has between the kept ones.
fn off(keys: &[KeyFrame], [from, to, frame]: [usize; 3], block: &Range<usize>) -> f64 {
    let [a, b, wanted] = [from, to, frame].map(|key| &keys[key][block.clone()]);
    let alpha = match from == to {
        true => 0.0,
        false => ((frame - from) as f64 / (to - from) as f64) as f32,
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

/// How far the kept frames' motion is from the original, over all original frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The largest distance, in scene units; infinite where a vertex is finite in one and not in the other.
    pub max_error: f64,
    /// The first original frame, and the first vertex in it, with that distance; nothing if it is 0.
    pub worst: Option<(usize, usize)>,
    /// Root of the mean square distance over all frames and the vertices finite in them.
    pub rms: f64,
}

/// Measures `kept` against all of `keys`.
///
/// # Panics
/// If `kept` is no ascending list of frames of `keys` with both ends, nor a single one.
#[must_use]
pub fn measure(keys: &[KeyFrame], kept: &[usize]) -> Fit {
    let ascending = kept.windows(2).all(|w| w[0] < w[1]);
    let ends = (kept.first(), kept.last());
    assert!(
        ascending && (kept.len() == 1 || ends == (Some(&0), Some(&(keys.len() - 1)))),
        "kept frames ascend from the first to the last"
    );
    let times: Vec<f64> = kept.iter().map(|&k| k as f64).collect();
    let pose = |frame: usize| Pose::among(frame as f64, &times);
    let frames = (0..keys.len()).into_par_iter();
    let tallies = frames.map(|frame| tally(keys, kept, (frame, pose(frame))));
    let tallies: Vec<_> = tallies.collect();
    let mut fit = Fit {
        max_error: 0.0,
        worst: None,
        rms: 0.0,
    };
    // Frames are added up in order, so that the sum is the same for every number of threads.
    let (mut sum, mut finite) = (0.0, 0);
    for (frame, ((worst, vertex), its_sum, its_finite)) in tallies.into_iter().enumerate() {
        sum += its_sum;
        finite += its_finite;
        if worst.sqrt() > fit.max_error {
            fit.max_error = worst.sqrt();
            fit.worst = Some((frame, vertex));
        }
    }
    fit.rms = (sum / finite.max(1) as f64).sqrt();
    fit
}

/// Of one frame: the largest square and its vertex, the sum of all squares, and how many vertices are finite.
fn tally(
    keys: &[KeyFrame],
    kept: &[usize],
    (frame, pose): (usize, Pose),
) -> ((f64, usize), f64, usize) {
    let from = &keys[kept[pose.key as usize]];
    // At weight 0 the later frame is not read.
    let to = kept.get(pose.key as usize + 1).map_or(from, |&k| &keys[k]);
    let (mut worst, mut sum, mut finite) = ((0.0, 0), 0.0, 0);
    for (vertex, &wanted) in keys[frame].iter().enumerate() {
        let square = square(pose.blend(from[vertex], to[vertex]), wanted);
        if square > worst.0 {
            worst = (square, vertex);
        }
        sum += square;
        finite += usize::from(wanted.iter().all(|x| x.is_finite()));
    }
    (worst, sum, finite)
}
