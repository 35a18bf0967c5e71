//! Fills pictures and lists in parallel, tile by tile, so that neighbouring rays run together.

use backend::Rays;
use geom::Hit;
use std::ops::Add;

/// Number of rows and of columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 512;

/// The result of one ray: its closest hit, and 1 if that hit is in shadow. For any-hit queries, the 1 means that the
/// ray hits anything.
pub type Answer = (Hit, u8);

/// Totals over some rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of closest hits.
    pub hits: u64,
    /// Number of answers whose second part is 1.
    pub blocked: u64,
}

impl Add for Counts {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            hits: self.hits + other.hits,
            blocked: self.blocked + other.blocked,
        }
    }
}

impl Counts {
    /// Returns the counts of one answer.
    #[inline(always)]
    pub fn of(answer: &Answer) -> Self {
        Self {
            hits: u64::from(answer.0.is_hit()),
            blocked: u64::from(answer.1),
        }
    }
}

/// Destination of the answers, one entry per ray in each slice. Slices that the query does not need are empty.
#[derive(Debug, Default)]
pub struct Output<'a> {
    closest: &'a mut [Hit],
    blocked: &'a mut [u8],
}

impl<'a> Output<'a> {
    /// Creates the output of a query. Slices that the query does not need are empty.
    pub fn new(closest: &'a mut [Hit], blocked: &'a mut [u8]) -> Self {
        Self { closest, blocked }
    }

    /// Returns the number of answers.
    #[inline]
    fn count(&self) -> usize {
        self.closest.len().max(self.blocked.len())
    }

    /// Splits off the entries from `at` on.
    #[inline]
    fn split_off(&mut self, at: usize) -> Self {
        let Self { closest, blocked } = std::mem::take(self);
        let (a, b) = closest.split_at_mut(at.min(closest.len()));
        let (c, d) = blocked.split_at_mut(at.min(blocked.len()));
        *self = Self::new(a, c);
        Self::new(b, d)
    }

    /// Writes the answer of one ray.
    #[inline(always)]
    fn set(&mut self, index: usize, (hit, blocked): Answer) {
        if let Some(to) = self.closest.get_mut(index) {
            *to = hit;
        }
        if let Some(to) = self.blocked.get_mut(index) {
            *to = blocked;
        }
    }
}

/// Fills `out` with the answers of these rays in parallel, and sums the results of the tasks. Each task gets some tiles
/// of a camera's picture, or neighbouring entries of a list as a single row.
pub fn fill(rays: Rays<'_>, out: Output<'_>, task: impl Fn(Tiles<'_>) -> Counts + Sync) -> Counts {
    match rays {
        Rays::Camera(camera) if out.count() > 0 => {
            let width = camera.width as usize;
            let band = |part| divide(Tiles::of(part, width), &Tiles::halve, &task);
            divide((0, out), &halve(TILE * width), &band)
        }
        _ => divide((0, out), &halve(RUN), &|part| task(Tiles::of(part, RUN))),
    }
}

/// Consecutive entries, with the index of the first.
type Part<'a> = (usize, Output<'a>);

/// Returns a function that splits off the second half of parts with more than `unit` entries, at a multiple of `unit`.
fn halve(unit: usize) -> impl for<'a> Fn(&mut Part<'a>) -> Option<Part<'a>> + Sync {
    move |(first, out)| {
        let half = (out.count() / 2).next_multiple_of(unit);
        (out.count() > unit).then(|| (*first + half, out.split_off(half)))
    }
}

/// Halves `left` recursively while `halve` succeeds, runs `task` on the parts in parallel, and sums the results.
fn divide<T: Send>(
    mut left: T,
    halve: &(impl Fn(&mut T) -> Option<T> + Sync),
    task: &(impl Fn(T) -> Counts + Sync),
) -> Counts {
    let Some(right) = halve(&mut left) else {
        return task(left);
    };
    let left = || divide(left, halve, task);
    let (a, b) = rayon::join(left, || divide(right, halve, task));
    a + b
}

/// A band of rows, or some of its columns. A list is one row.
#[derive(Debug)]
pub struct Tiles<'a> {
    rows: [Output<'a>; TILE],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Columns of the whole picture.
    width: usize,
}

impl<'a> Tiles<'a> {
    /// Splits one band into rows.
    fn of((first, mut rest): Part<'a>, width: usize) -> Self {
        let rows = std::array::from_fn(|_| {
            let below = rest.split_off(width);
            std::mem::replace(&mut rest, below)
        });
        Self { rows, first, width }
    }

    /// Returns the number of columns of the part.
    pub fn columns(&self) -> usize {
        self.rows[0].count()
    }

    /// Returns the number of rows within the picture.
    #[inline]
    pub fn height(&self) -> usize {
        self.rows.iter().filter(|row| row.count() > 0).count()
    }

    /// Returns the number of columns of the whole picture.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the index of an entry in the picture.
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        self.first + y * self.width + x
    }

    /// Writes the answer of one ray.
    #[inline(always)]
    pub fn set(&mut self, x: usize, y: usize, answer: Answer) {
        self.rows[y].set(x, answer);
    }

    /// Splits off the second half of the columns, unless few tiles are left.
    fn halve(&mut self) -> Option<Self> {
        if self.columns() <= TILE * TILES {
            return None;
        }
        let column = (self.columns() / 2).next_multiple_of(TILE);
        let rows = self.rows.each_mut().map(|row| row.split_off(column));
        let (first, width) = (self.first + column, self.width);
        Some(Self { rows, first, width })
    }

    /// Fills all entries by ray index, tile after tile.
    #[inline]
    pub fn fill(mut self, mut answer: impl FnMut(usize) -> Answer) {
        for column in (0..self.columns()).step_by(TILE) {
            for (y, row) in self.rows.iter_mut().enumerate() {
                for x in column..row.count().min(column + TILE) {
                    row.set(x, answer(self.first + y * self.width + x));
                }
            }
        }
    }
}
