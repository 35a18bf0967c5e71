//! Fills pictures and lists in parallel, tile by tile, so that neighbouring rays run together.

use rayon::prelude::*;

/// Rows of a band, and columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 256;

/// Hands `task` neighbouring entries of a list and the index of the first, until it saw all. Sums what it returns.
pub(crate) fn fill_list<T: Send>(
    out: &mut [T],
    task: impl Fn(usize, &mut [T]) -> u64 + Sync,
) -> u64 {
    let runs = out.par_chunks_mut(RUN).enumerate();
    runs.map(|(run, out)| task(run * RUN, out)).sum()
}

/// As [`fill_list`], for a picture of rows `width` entries wide, in neighbouring tiles.
pub(crate) fn fill_picture<T: Send>(
    out: &mut [T],
    width: usize,
    task: impl Fn(Tiles<'_, T>) -> u64 + Sync,
) -> u64 {
    let bands = out.par_chunks_mut(TILE * width).enumerate();
    bands
        .map(|(band, out)| {
            let mut rows = out.chunks_mut(width);
            let rows = std::array::from_fn(|_| rows.next().unwrap_or_default());
            let first = band * TILE * width;
            split(Tiles { rows, first, width }, &task)
        })
        .sum()
}

/// A band of rows or a part of it.
pub(crate) struct Tiles<'a, T> {
    rows: [&'a mut [T]; TILE],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Of the whole picture.
    width: usize,
}

impl<T> Tiles<'_, T> {
    pub(crate) fn columns(&self) -> usize {
        self.rows[0].len()
    }

    /// Rows that reach into the picture.
    #[inline]
    pub(crate) fn height(&self) -> usize {
        self.rows.iter().filter(|row| !row.is_empty()).count()
    }

    /// Columns of the whole picture.
    #[inline]
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Where an entry lies in the picture.
    #[inline]
    pub(crate) fn index(&self, x: usize, y: usize) -> usize {
        self.first + y * self.width + x
    }

    #[inline]
    pub(crate) fn entry(&mut self, x: usize, y: usize) -> &mut T {
        &mut self.rows[y][x]
    }

    /// Cuts off the columns from `column` on.
    fn split_at(self, column: usize) -> (Self, Self) {
        let (first, width) = (self.first, self.width);
        let mut right: [&mut [T]; TILE] = std::array::from_fn(|_| Default::default());
        let mut cut = right.iter_mut();
        let rows = self.rows.map(|row| {
            let (a, b) = row.split_at_mut(column.min(row.len()));
            if let Some(slot) = cut.next() {
                *slot = b;
            }
            a
        });
        let left = Self { rows, first, width };
        let first = first + column;
        let rows = right;
        (left, Self { rows, first, width })
    }

    /// Visits every entry with its index, tile after tile.
    #[inline]
    pub(crate) fn for_each(mut self, mut visit: impl FnMut(usize, &mut T)) {
        for column in (0..self.columns()).step_by(TILE) {
            for (y, row) in self.rows.iter_mut().enumerate() {
                let tile = row.iter_mut().enumerate().skip(column).take(TILE);
                for (x, entry) in tile {
                    visit(self.first + y * self.width + x, entry);
                }
            }
        }
    }
}

/// Halves a band until few tiles are left.
fn split<T: Send>(tiles: Tiles<'_, T>, fill: &(impl Fn(Tiles<'_, T>) -> u64 + Sync)) -> u64 {
    if tiles.columns() <= TILE * TILES {
        return fill(tiles);
    }
    let half = (tiles.columns() / 2).next_multiple_of(TILE);
    let (left, right) = tiles.split_at(half);
    let (a, b) = rayon::join(|| split(left, fill), || split(right, fill));
    a + b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_made_from_its_own_index() {
        for (width, height) in [(1, 1), (7, 3), (64, 8), (65, 9), (1000, 17)] {
            let mut out = vec![usize::MAX; width * height];
            let count = fill_picture(&mut out, width, |tiles| {
                let mut odd = 0;
                tiles.for_each(|i, entry| {
                    *entry = i;
                    odd += (i % 2) as u64;
                });
                odd
            });
            assert!(
                out.iter().enumerate().all(|(i, &o)| i == o),
                "{width}x{height}"
            );
            assert_eq!(count, (width * height / 2) as u64);
            out.fill(usize::MAX);
            let made = fill_list(&mut out, |first, out| {
                (first..)
                    .zip(out.iter_mut())
                    .for_each(|(i, entry)| *entry = i);
                (first..first + out.len()).filter(|i| i % 2 == 1).count() as u64
            });
            assert_eq!(made, count);
            assert!(out.iter().enumerate().all(|(i, &o)| i == o));
        }
    }
}
