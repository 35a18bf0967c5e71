//! Divides pictures and lists among tasks, tile by tile, so that neighbouring rays run together.

use backend::Rays;
use cpu_ref::{HitCounts, RayResult, TraceOutput};

/// Number of rows and of columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 512;

/// Divides `out` among parallel runs of `task`, which trace `rays`. Returns the sum of their results. Each run gets
/// some tiles of a camera's picture, or neighbouring entries of a list as a single row.
pub(crate) fn fill(
    rays: Rays<'_>,
    out: TraceOutput<'_>,
    task: impl Fn(Tiles<'_>) -> HitCounts + Sync,
) -> HitCounts {
    let all = Part { first: 0, out };
    match rays {
        Rays::Camera(camera) if all.out.count() > 0 => {
            let width = camera.width as usize;
            let band = |part| divide(Tiles::of(part, width), &Tiles::halve, &task);
            divide(all, &|part| part.halve(TILE * width), &band)
        }
        _ => {
            let row = |part| task(Tiles::of(part, RUN));
            divide(all, &|part| part.halve(RUN), &row)
        }
    }
}

/// Consecutive entries of the output.
struct Part<'a> {
    /// Index of the first entry.
    first: usize,
    out: TraceOutput<'a>,
}

impl Part<'_> {
    /// Splits off the second half at a multiple of `unit`, if there are more than `unit` entries.
    fn halve(&mut self, unit: usize) -> Option<Self> {
        let half = (self.out.count() / 2).next_multiple_of(unit);
        (self.out.count() > unit).then(|| Part {
            first: self.first + half,
            out: self.out.split_off(half),
        })
    }
}

/// Halves `left` recursively while `halve` succeeds, runs `task` on the parts in parallel, and sums the results.
fn divide<T: Send>(
    mut left: T,
    halve: &(impl Fn(&mut T) -> Option<T> + Sync),
    task: &(impl Fn(T) -> HitCounts + Sync),
) -> HitCounts {
    let Some(right) = halve(&mut left) else {
        return task(left);
    };
    let left = || divide(left, halve, task);
    let (a, b) = rayon::join(left, || divide(right, halve, task));
    a + b
}

/// A band of rows, or some of its columns. A list is one row.
#[derive(Debug)]
pub(crate) struct Tiles<'a> {
    rows: [TraceOutput<'a>; TILE],
    /// Index of the first entry of the first row in the picture.
    first: usize,
    /// Columns of the whole picture.
    pub(crate) width: usize,
}

impl<'a> Tiles<'a> {
    /// Splits one band into rows.
    fn of(
        Part {
            first,
            out: mut rest,
        }: Part<'a>,
        width: usize,
    ) -> Self {
        let rows = std::array::from_fn(|_| {
            let below = rest.split_off(width);
            std::mem::replace(&mut rest, below)
        });
        Self { rows, first, width }
    }

    /// Returns the number of columns of the part.
    pub(crate) fn columns(&self) -> usize {
        self.rows[0].count()
    }

    /// Returns the number of rows within the picture.
    #[inline]
    pub(crate) fn height(&self) -> usize {
        self.rows.iter().filter(|row| row.count() > 0).count()
    }

    /// Returns the index of an entry in the picture.
    #[inline]
    pub(crate) fn index(&self, x: usize, y: usize) -> usize {
        self.first + y * self.width + x
    }

    /// Writes the result of one ray.
    #[inline(always)]
    pub(crate) fn set(&mut self, x: usize, y: usize, result: RayResult) {
        self.rows[y].set(x, result);
    }

    /// Splits off the second half of the columns. Returns `None` if at most [`TILES`] tiles are left.
    fn halve(&mut self) -> Option<Self> {
        if self.columns() <= TILE * TILES {
            return None;
        }
        let column = (self.columns() / 2).next_multiple_of(TILE);
        let rows = self.rows.each_mut().map(|row| row.split_off(column));
        let (first, width) = (self.first + column, self.width);
        Some(Self { rows, first, width })
    }
}
