//! How large a key frame's coordinates are, found fast enough to be done for each frame that arrives.

use crate::{KeyFrame, Point, Range, lock};
use rayon::prelude::*;
use std::ops;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Vertices that one task looks at.
const RUN: usize = 1 << 15;
/// Threads that help with a key frame.
const HELPERS: usize = 7;

/// Sizes of a key frame's finite coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes {
    pub(crate) largest: f32,
    /// The third least of the largest coordinates of vertices: no triangle but a flat one lies nearer to the origin.
    pub(crate) third: f32,
    /// The lower quartile of the largest coordinates of vertices.
    pub(crate) typical: f32,
}

impl Sizes {
    pub(crate) fn of(key: &[Point]) -> Self {
        let runs = key.par_chunks(RUN).map(Extremes::of);
        let found = runs.reduce(|| Extremes::NONE, Extremes::join);
        Self::with(found, samples_at(key, sampled(key.len())).collect())
    }

    /// Likewise, of a key frame in which only some vertices are new. By this thread and whoever else comes in time: while the
    /// builder is busy, others are slow to wake.
    pub(crate) fn of_new(key: &KeyFrame, parts: &Parts) -> Self {
        let look = Arc::new(Look {
            key: Arc::clone(key),
            runs: Arc::clone(&parts.runs),
            begun: AtomicUsize::new(0),
            done: Mutex::new((0, parts.rest)),
        });
        for _ in 1..parts.runs.len().min(HELPERS + 1) {
            // Who comes too late finds nothing, and keeps nothing.
            let look = Arc::downgrade(&look);
            rayon::spawn(move || look.upgrade().iter().for_each(|look| look.help()));
        }
        look.help();
        loop {
            let (done, found) = *lock(&look.done);
            if done == parts.runs.len() {
                let new = samples_at(key, parts.sampled.iter().copied());
                let all = parts.samples.iter().copied().chain(new);
                return Self::with(found, all.collect());
            }
            std::hint::spin_loop();
        }
    }

    fn with(Extremes { largest, least }: Extremes, mut samples: Vec<f32>) -> Self {
        let quartile = samples.len() / 4;
        let typical = match samples.is_empty() {
            true => largest,
            false => *samples.select_nth_unstable_by(quartile, f32::total_cmp).1,
        };
        Self {
            largest,
            third: least[2],
            typical,
        }
    }
}

/// Vertices from which the typical size of so many is found.
fn sampled(vertices: usize) -> impl Iterator<Item = usize> {
    (0..vertices).step_by(Range::sample_step(vertices))
}

/// Their sizes, but for those that say nothing.
fn samples_at(key: &[Point], vertices: impl Iterator<Item = usize>) -> impl Iterator<Item = f32> {
    let sizes = vertices.map(|v| size(key[v]));
    sizes.filter(|x| x.is_finite() && *x > 0.0)
}

/// Vertices that may be elsewhere in the next key frame, and what the rest come to.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    /// Each for one task.
    runs: Arc<[ops::Range<usize>]>,
    /// Of these, the ones from which the typical size is found.
    sampled: Vec<usize>,
    rest: Extremes,
    samples: Vec<f32>,
}

impl Parts {
    /// Of a key frame, by runs of vertices in order.
    pub(crate) fn of(key: &[Point], moving: &[ops::Range<usize>]) -> Self {
        let starts = moving.iter().map(|run| run.start).chain([key.len()]);
        let ends = moving.iter().map(|run| run.end);
        let between = std::iter::once(0).chain(ends).zip(starts);
        let rest = between.map(|(from, to)| Extremes::of(&key[from..to]));
        let split = |run: &ops::Range<usize>| {
            let end = run.end;
            let starts = run.clone().step_by(RUN);
            starts.map(move |at| at..end.min(at + RUN))
        };
        let moves = |&v: &usize| moving.iter().any(|run| run.contains(&v));
        let (sampled, still): (Vec<_>, Vec<_>) = sampled(key.len()).partition(moves);
        Self {
            runs: moving.iter().flat_map(split).collect(),
            sampled,
            samples: samples_at(key, still.into_iter()).collect(),
            rest: rest.fold(Extremes::NONE, Extremes::join),
        }
    }
}

/// A key frame that several threads look at.
struct Look {
    key: KeyFrame,
    runs: Arc<[ops::Range<usize>]>,
    /// Runs that somebody took.
    begun: AtomicUsize,
    /// Runs that were looked at, and what was found there.
    done: Mutex<(usize, Extremes)>,
}

impl Look {
    /// Looks at runs until all are taken.
    fn help(&self) {
        loop {
            let next = self.begun.fetch_add(1, Ordering::Relaxed);
            let Some(run) = self.runs.get(next) else {
                return;
            };
            let found = Extremes::of(&self.key[run.clone()]);
            let mut done = lock(&self.done);
            *done = (done.0 + 1, done.1.join(found));
        }
    }
}

/// The farthest and the nearest of some vertices.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    /// The largest finite `|coordinate|`.
    largest: f32,
    /// The sizes of the three vertices that are nearest to the origin, in order.
    least: [f32; 3],
}

impl Extremes {
    /// Of no vertices.
    const NONE: Self = Self {
        largest: 0.0,
        least: [f32::INFINITY; 3],
    };

    /// Looks at groups, most of which have nothing new.
    fn of(points: &[Point]) -> Self {
        const GROUP: usize = 16;
        points.chunks(GROUP).fold(Self::NONE, |found, group| {
            let has_new = |&p: &Point| {
                let size = size(p);
                size.is_nan() | (size > found.largest) | (size < found.least[2])
            };
            match group.iter().fold(false, |any, p| any | has_new(p)) {
                true => group.iter().fold(found, Self::with),
                false => found,
            }
        })
    }

    fn with(self, point: &Point) -> Self {
        let sizes = point.iter().map(|x| x.abs()).filter(|x| x.is_finite());
        Self {
            largest: sizes.fold(self.largest, f32::max),
            least: insert(self.least, size(*point)),
        }
    }

    fn join(self, other: Self) -> Self {
        Self {
            largest: self.largest.max(other.largest),
            least: other.least.into_iter().fold(self.least, insert),
        }
    }
}

/// The three least of four, of which three are in order.
fn insert([a, b, c]: [f32; 3], new: f32) -> [f32; 3] {
    match new {
        _ if new < a => [new, a, b],
        _ if new < b => [a, new, b],
        _ if new < c => [a, b, new],
        _ => [a, b, c],
    }
}

/// The largest `|coordinate|`; a NaN if one is.
pub(crate) fn size(p: Point) -> f32 {
    let [x, y, z] = p.map(f32::abs);
    let sum = x + y + z;
    if sum.is_nan() {
        return sum;
    }
    x.max(y).max(z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::range::tests::cloud;

    #[test]
    fn extremes_are_found_among_vertices_that_are_not_finite() {
        let mut points = cloud(0.5);
        points.extend([[f32::NAN, 9.0, 0.0], [1.0, f32::INFINITY, 2.0], [1e-9; 3]]);
        points.extend(cloud(1e-7));
        for n in 0..points.len() {
            points.rotate_left(1);
            let found = Extremes::of(&points);
            let found = (found.largest, found.least[..2].to_vec());
            assert_eq!(found, (9.0, vec![1e-9, 1e-7]), "{n}");
        }
    }

    #[test]
    fn a_key_frame_is_the_same_in_parts_and_whole() {
        let far = [[1e9; 3], [3e-12; 3], [f32::NAN; 3]];
        let mut key: Vec<Point> = (1..100_000).map(|i| [i as f32, 0.25, 1.0]).collect();
        key.splice(70_000..70_000, far);
        for runs in [
            vec![],
            vec![0..50_000, 50_000..key.len()],
            vec![3..9, 40_000..90_000],
        ] {
            let parts = Parts::of(&key, &runs);
            let whole = Sizes::of(&key);
            assert_eq!(Sizes::of_new(&Arc::new(key.clone().into()), &parts), whole);
            assert_eq!((whole.largest, whole.third), (1e9, 2.0), "{runs:?}");
        }
    }
}
