//! Fills pictures and lists in parallel, tile by tile, so that neighbouring rays run together.

use backend::{QueryKind, Rays};
use geom::Hit;
use std::ops::Add;

/// Rows and columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 256;

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
    #[must_use]
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
    /// For all answers to a query of that kind.
    #[must_use]
    pub fn new(kind: QueryKind, closest: &'a mut [Hit], blocked: &'a mut [u8]) -> Self {
        match kind {
            QueryKind::Closest => Self {
                closest,
                ..Self::default()
            },
            QueryKind::Any => Self {
                blocked,
                ..Self::default()
            },
            QueryKind::ClosestAndShadow { .. } => Self { closest, blocked },
        }
    }

    /// How many answers it holds.
    #[must_use]
    #[inline]
    pub fn count(&self) -> usize {
        self.closest.len().max(self.blocked.len())
    }

    #[inline]
    fn split(self, at: usize) -> [Self; 2] {
        let (a, b) = self.closest.split_at_mut(at.min(self.closest.len()));
        let (c, d) = self.blocked.split_at_mut(at.min(self.blocked.len()));
        let half = |closest, blocked| Self { closest, blocked };
        [half(a, c), half(b, d)]
    }

    /// Writes the answer of one ray.
    #[inline(always)]
    pub fn set(&mut self, index: usize, (hit, blocked): Answer) {
        if let Some(to) = self.closest.get_mut(index) {
            *to = hit;
        }
        if let Some(to) = self.blocked.get_mut(index) {
            *to = blocked;
        }
    }
}

/// Fills `out` with the answers of these rays in parallel, and sums what the tasks return: `list` gets neighbouring
/// entries of a list and the index of the first, `picture` some tiles of a camera's picture.
pub fn fill(
    rays: Rays<'_>,
    out: Output<'_>,
    list: impl Fn(usize, Output<'_>) -> Counts + Sync,
    picture: impl Fn(Tiles<'_>) -> Counts + Sync,
) -> Counts {
    match rays {
        Rays::Camera(camera) if out.count() > 0 => {
            split_rows((0, out), camera.width as usize, &picture)
        }
        _ => split_list((0, out), &list),
    }
}

/// Halves a list until it is short.
fn split_list(
    (first, out): (usize, Output<'_>),
    task: &(impl Fn(usize, Output<'_>) -> Counts + Sync),
) -> Counts {
    if out.count() <= RUN {
        return task(first, out);
    }
    let half = (out.count() / 2).next_multiple_of(RUN);
    let [left, right] = out.split(half);
    let left = || split_list((first, left), task);
    let (a, b) = rayon::join(left, || split_list((first + half, right), task));
    a + b
}

/// Halves a picture until it is one band of rows.
fn split_rows(
    (first, out): (usize, Output<'_>),
    width: usize,
    task: &(impl Fn(Tiles<'_>) -> Counts + Sync),
) -> Counts {
    let count = out.count() / width;
    if count <= TILE {
        let mut rest = out;
        let rows = std::array::from_fn(|_| {
            let [row, below] = std::mem::take(&mut rest).split(width);
            rest = below;
            row
        });
        return split_band(Tiles { rows, first, width }, task);
    }
    let half = (count / 2).next_multiple_of(TILE) * width;
    let [upper, lower] = out.split(half);
    let upper = || split_rows((first, upper), width, task);
    let (a, b) = rayon::join(upper, || split_rows((first + half, lower), width, task));
    a + b
}

/// Halves a band until few tiles are left.
fn split_band(tiles: Tiles<'_>, task: &(impl Fn(Tiles<'_>) -> Counts + Sync)) -> Counts {
    if tiles.columns() <= TILE * TILES {
        return task(tiles);
    }
    let half = (tiles.columns() / 2).next_multiple_of(TILE);
    let [left, right] = tiles.split(half);
    let (a, b) = rayon::join(|| split_band(left, task), || split_band(right, task));
    a + b
}

/// A band of rows or a part of it.
#[derive(Debug)]
pub struct Tiles<'a> {
    rows: [Output<'a>; TILE],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Of the whole picture.
    width: usize,
}

impl Tiles<'_> {
    /// Columns of the part.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.rows[0].count()
    }

    /// Rows that reach into the picture.
    #[must_use]
    #[inline]
    pub fn height(&self) -> usize {
        self.rows.iter().filter(|row| row.count() > 0).count()
    }

    /// Columns of the whole picture.
    #[must_use]
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Where an entry lies in the picture.
    #[must_use]
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        self.first + y * self.width + x
    }

    /// Writes the answer of one ray.
    #[inline(always)]
    pub fn set(&mut self, x: usize, y: usize, answer: Answer) {
        self.rows[y].set(x, answer);
    }

    /// Cuts off the columns from `column` on.
    fn split(self, column: usize) -> [Self; 2] {
        let (first, width) = (self.first, self.width);
        let mut right: [Output<'_>; TILE] = Default::default();
        let mut places = right.iter_mut();
        let rows = self.rows.map(|row| {
            let [a, b] = row.split(column);
            if let Some(place) = places.next() {
                *place = b;
            }
            a
        });
        let left = Self { rows, first, width };
        let (rows, first) = (right, first + column);
        [left, Self { rows, first, width }]
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
