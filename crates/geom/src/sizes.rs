//! How large a key frame's coordinates are, found fast enough to be done for each frame that arrives.

use crate::{Point, Range, in_parallel};
use rayon::prelude::*;

/// Vertices that one task looks at.
const RUN: usize = 1 << 15;

/// Sizes of a key frame's finite coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes {
    pub(crate) largest: f32,
    /// The second least of the largest coordinates of vertices that are not the origin. Every triangle with an area has a
    /// coordinate of this size or more.
    pub(crate) second: f32,
    /// The lower quartile of the largest coordinates of vertices.
    pub(crate) typical: f32,
}

impl Sizes {
    pub(crate) fn of(key: &[Point]) -> Self {
        let Extremes { largest, least } = match key.len() <= RUN {
            true => Extremes::of(key),
            false => in_parallel(|| {
                let runs = key.par_chunks(RUN).map(Extremes::of);
                runs.reduce(|| Extremes::NONE, Extremes::join)
            }),
        };
        let samples = key.iter().step_by(Range::sample_step(key.len()));
        // Those that say something.
        let samples = samples.map(|&p| size(p));
        let mut samples: Vec<f32> = samples.filter(|x| x.is_finite() && *x > 0.0).collect();
        let quartile = samples.len() / 4;
        let typical = match samples.is_empty() {
            true => largest,
            false => *samples.select_nth_unstable_by(quartile, f32::total_cmp).1,
        };
        Self {
            largest,
            second: least[1],
            typical,
        }
    }
}

/// The farthest and the nearest of some vertices.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    /// The largest finite `|coordinate|`.
    largest: f32,
    /// The sizes of the two vertices that are nearest to the origin without being it, in order.
    least: [f32; 2],
}

impl Extremes {
    /// Of no vertices.
    const NONE: Self = Self {
        largest: 0.0,
        least: [f32::INFINITY; 2],
    };

    /// Looks at groups, most of which have nothing new.
    fn of(points: &[Point]) -> Self {
        const GROUP: usize = 16;
        points.chunks(GROUP).fold(Self::NONE, |found, group| {
            let has_new = |&p: &Point| {
                let size = size(p);
                size.is_nan() | (size > found.largest) | ((size < found.least[1]) & (size > 0.0))
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

/// The two least of three sizes, the first two in order. A new size of zero does not count.
fn insert([a, b]: [f32; 2], new: f32) -> [f32; 2] {
    match new {
        0.0 => [a, b],
        _ if new < a => [new, a],
        _ if new < b => [a, new],
        _ => [a, b],
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
        points.extend([[0.0; 3], [0.0, -0.0, 0.0]]);
        points.extend(cloud(1e-7));
        for n in 0..points.len() {
            points.rotate_left(1);
            let found = Extremes::of(&points);
            let found = (found.largest, found.least);
            assert_eq!(found, (9.0, [1e-9, 1e-7]), "{n}");
        }
    }
}
