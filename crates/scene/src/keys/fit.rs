//! How well kept frames stand for all: measured afresh, frame by frame, as a renderer would play them.

use crate::keys::interval::{square, weight};
use geom::{Point, Pose};
use rayon::prelude::*;

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

/// The blend of `kept` frames at the time of an original `frame`; [`Pose::key`] counts kept frames.
///
/// # Panics
/// If `kept` is empty, or `frame` is beyond its ends and it is not alone.
#[must_use]
pub fn pose(kept: &[usize], frame: usize) -> Pose {
    let key = kept.partition_point(|&k| k <= frame).saturating_sub(1);
    let alone = kept.len() == 1 || kept[key] == frame;
    let alpha = if alone {
        0.0
    } else {
        weight(kept[key], frame, kept[key + 1])
    };
    Pose {
        key: key as u32,
        alpha,
    }
}

/// What one frame adds.
#[derive(Clone, Copy)]
struct Tally {
    worst: f64,
    vertex: usize,
    sum: f64,
    finite: usize,
}

/// Measures `kept` against all of `keys`.
///
/// # Panics
/// If `kept` is no ascending list of frames of `keys` with both ends, nor a single one.
#[must_use]
pub fn measure(keys: &[Vec<Point>], kept: &[usize]) -> Fit {
    let ascending = kept.windows(2).all(|w| w[0] < w[1]);
    let ends = (kept.first(), kept.last());
    assert!(
        ascending && (kept.len() == 1 || ends == (Some(&0), Some(&(keys.len() - 1)))),
        "kept frames ascend from the first to the last"
    );
    let tallies: Vec<Tally> = (0..keys.len())
        .into_par_iter()
        .map(|frame| tally(keys, kept, frame))
        .collect();
    // Frames are added up in order, so that the sum is the same for every number of threads.
    let sum: f64 = tallies.iter().map(|t| t.sum).sum();
    let finite: usize = tallies.iter().map(|t| t.finite).sum();
    let mut fit = Fit {
        max_error: 0.0,
        worst: None,
        rms: (sum / finite.max(1) as f64).sqrt(),
    };
    for (frame, t) in tallies.iter().enumerate() {
        if t.worst.sqrt() > fit.max_error {
            fit.max_error = t.worst.sqrt();
            fit.worst = Some((frame, t.vertex));
        }
    }
    fit
}

fn tally(keys: &[Vec<Point>], kept: &[usize], frame: usize) -> Tally {
    let pose = pose(kept, frame);
    let from = &keys[kept[pose.key as usize]];
    // At weight 0 the later frame is not read.
    let to = kept.get(pose.key as usize + 1).map_or(from, |&k| &keys[k]);
    let mut tally = Tally {
        worst: 0.0,
        vertex: 0,
        sum: 0.0,
        finite: 0,
    };
    for (vertex, &wanted) in keys[frame].iter().enumerate() {
        let square = square(pose.blend(from[vertex], to[vertex]), wanted);
        if square > tally.worst {
            (tally.worst, tally.vertex) = (square, vertex);
        }
        tally.sum += square;
        tally.finite += usize::from(wanted.iter().all(|x| x.is_finite()));
    }
    tally
}
