//! Sizes of a key frame's coordinates. This code runs for every frame that arrives, so it must be fast.

use crate::{CoordinateRange, Point, in_parallel};
use rayon::prelude::*;

/// Number of vertices per parallel task.
const RUN: usize = 1 << 15;

/// Sizes of a key frame's finite coordinates. The size of a vertex is its largest `|coordinate|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes {
    pub(crate) largest: f32,
    /// Second smallest size of the vertices that are not at the origin.
    ///
    /// A triangle with a nonzero area has at least two such vertices. So it has a coordinate of at least this size.
    pub(crate) second_smallest: f32,
    /// Lower quartile of the sizes of sampled vertices.
    pub(crate) typical: f32,
}

impl Sizes {
    pub(crate) fn of(key: &[Point]) -> Self {
        let SizeExtremes { largest, least } = if key.len() <= RUN {
            SizeExtremes::of(key)
        } else {
            in_parallel(|| {
                let runs = key.par_chunks(RUN).map(SizeExtremes::of);
                runs.reduce(|| SizeExtremes::NONE, SizeExtremes::join)
            })
        };
        let samples = key.iter().step_by(CoordinateRange::sample_step(key.len()));
        // Vertices that are zero or not finite do not count.
        let samples = samples.map(|&p| size(p));
        let mut samples: Vec<f32> = samples.filter(|x| x.is_finite() && *x > 0.0).collect();
        let quartile = samples.len() / 4;
        let typical = if samples.is_empty() {
            largest
        } else {
            *samples.select_nth_unstable_by(quartile, f32::total_cmp).1
        };
        Self {
            largest,
            second_smallest: least[1],
            typical,
        }
    }
}

/// Largest coordinate and smallest sizes of a set of vertices.
#[derive(Clone, Copy, Debug)]
struct SizeExtremes {
    /// The largest finite `|coordinate|`.
    largest: f32,
    /// Sizes of the two vertices closest to the origin but not at it, in ascending order.
    least: [f32; 2],
}

impl SizeExtremes {
    /// Extremes of an empty set.
    const NONE: Self = Self {
        largest: 0.0,
        least: [f32::INFINITY; 2],
    };

    /// Scans vertices in groups. Most groups contain no new extreme, and one branch skips them.
    fn of(points: &[Point]) -> Self {
        const GROUP: usize = 16;
        points.chunks(GROUP).fold(Self::NONE, |found, group| {
            let has_new = |&p: &Point| {
                let size = size(p);
                size.is_nan() | (size > found.largest) | ((size < found.least[1]) & (size > 0.0))
            };
            if group.iter().fold(false, |any, p| any | has_new(p)) {
                group.iter().fold(found, Self::with)
            } else {
                found
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

/// Returns the two smallest of three sizes, where `a` and `b` are sorted. A new size of zero is ignored.
fn insert([a, b]: [f32; 2], new: f32) -> [f32; 2] {
    match new {
        0.0 => [a, b],
        _ if new < a => [new, a],
        _ if new < b => [a, new],
        _ => [a, b],
    }
}

/// Returns the largest `|coordinate|`, or NaN if a coordinate is NaN.
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
    fn extremes_ignore_non_finite_coordinates() {
        let mut points = cloud(0.5);
        points.extend([[f32::NAN, 9.0, 0.0], [1.0, f32::INFINITY, 2.0], [1e-9; 3]]);
        points.extend([[0.0; 3], [0.0, -0.0, 0.0]]);
        points.extend(cloud(1e-7));
        for n in 0..points.len() {
            points.rotate_left(1);
            let found = SizeExtremes::of(&points);
            let found = (found.largest, found.least);
            assert_eq!(found, (9.0, [1e-9, 1e-7]), "{n}");
        }
    }
}
