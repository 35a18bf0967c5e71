//! Fills pictures and lists in parallel, tile by tile, so that neighbouring rays run together.

use backend::Rays;
use geom::Hit;
use std::ops::Add;

/// Rows and columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 512;

/// What is found of one ray: its closest hit, and 1 if the light does not reach that, or if the ray hits anything,
/// where only that is asked.
pub type Answer = (Hit, u8);

/// What some rays came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Closest hits.
    pub hits: u64,
    /// Ones among the second parts of answers.
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
    /// Those of one answer.
    #[inline(always)]
    pub fn of(answer: &Answer) -> Self {
        Self {
            hits: u64::from(answer.0.is_hit()),
            blocked: u64::from(answer.1),
        }
    }
}

/// Where answers go, one entry a ray in each slice. A slice of what is not asked is empty.
#[derive(Debug, Default)]
pub struct Output<'a> {
    closest: &'a mut [Hit],
    blocked: &'a mut [u8],
}

impl<'a> Output<'a> {
    /// For all answers to a query; what it does not ask for is empty.
    pub fn new(closest: &'a mut [Hit], blocked: &'a mut [u8]) -> Self {
        Self { closest, blocked }
    }

    /// How many answers it holds.
    #[inline]
    fn count(&self) -> usize {
        self.closest.len().max(self.blocked.len())
    }

    /// Cuts off all from entry `at` on.
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

/// Fills `out` with the answers of these rays in parallel, and sums what the tasks return: each gets some tiles of a
/// camera's picture, or neighbouring entries of a list as a single row.
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

/// Some entries, with the index of the first.
type Part<'a> = (usize, Output<'a>);

/// Cuts the second half off what holds more than `unit` entries, at a multiple of that.
fn halve(unit: usize) -> impl for<'a> Fn(&mut Part<'a>) -> Option<Part<'a>> + Sync {
    move |(first, out)| {
        let half = (out.count() / 2).next_multiple_of(unit);
        (out.count() > unit).then(|| (*first + half, out.split_off(half)))
    }
}

/// Halves `left` as often as that goes, gives the parts to `task` in parallel, and sums what it returns.
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

/// A band of rows or a part of it; or one row, of a list.
#[derive(Debug)]
pub struct Tiles<'a> {
    rows: [Output<'a>; TILE],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Of the whole picture.
    width: usize,
}

impl<'a> Tiles<'a> {
    /// Of one band of rows.
    fn of((first, mut rest): Part<'a>, width: usize) -> Self {
        let rows = std::array::from_fn(|_| {
            let below = rest.split_off(width);
            std::mem::replace(&mut rest, below)
        });
        Self { rows, first, width }
    }

    /// Columns of the part.
    pub fn columns(&self) -> usize {
        self.rows[0].count()
    }

    /// Rows that reach into the picture.
    #[inline]
    pub fn height(&self) -> usize {
        self.rows.iter().filter(|row| row.count() > 0).count()
    }

    /// Columns of the whole picture.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Where an entry lies in the picture.
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        self.first + y * self.width + x
    }

    /// Writes the answer of one ray.
    #[inline(always)]
    pub fn set(&mut self, x: usize, y: usize, answer: Answer) {
        self.rows[y].set(x, answer);
    }

    /// Cuts the second half off, unless few tiles are left.
    fn halve(&mut self) -> Option<Self> {
        if self.columns() <= TILE * TILES {
            return None;
        }
        let column = (self.columns() / 2).next_multiple_of(TILE);
        let rows = self.rows.each_mut().map(|row| row.split_off(column));
        let (first, width) = (self.first + column, self.width);
        Some(Self { rows, first, width })
    }

    /// Answers every ray by its index, tile after tile.
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
