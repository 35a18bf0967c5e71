//! Fills pictures and lists in parallel, tile by tile, so that neighbouring rays run together.

use rayon::prelude::*;

/// Rows of a band, and columns of a tile.
const TILE: usize = 8;
/// Tiles that one task handles.
const TILES: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 256;

/// Sets every entry of a list to `make(index)` and counts those that `counted` accepts.
///
/// `state` makes what one task keeps from entry to entry.
pub(crate) fn fill_list<T: Send, S>(
    out: &mut [T],
    state: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, usize) -> T + Sync,
    counted: impl Fn(&T) -> bool + Sync,
) -> u64 {
    let runs = out.par_chunks_mut(RUN).enumerate();
    runs.map(|(run, out)| {
        let mut state = state();
        let mut count = 0;
        for (i, entry) in out.iter_mut().enumerate() {
            *entry = make(&mut state, run * RUN + i);
            count += u64::from(counted(entry));
        }
        count
    })
    .sum()
}

/// As [`fill_list`], for a picture of rows `width` entries wide, in square tiles.
pub(crate) fn fill_picture<T: Send, S>(
    out: &mut [T],
    width: usize,
    state: impl Fn() -> S + Sync,
    make: impl Fn(&mut S, usize) -> T + Sync,
    counted: impl Fn(&T) -> bool + Sync,
) -> u64 {
    let fill = |tiles: Tiles<'_, T>| {
        let mut state = state();
        let mut count = 0;
        tiles.for_each(|index, entry| {
            *entry = make(&mut state, index);
            count += u64::from(counted(entry));
        });
        count
    };
    let bands = out.par_chunks_mut(TILE * width).enumerate();
    bands
        .map(|(band, out)| {
            let mut rows = out.chunks_mut(width);
            let rows = std::array::from_fn(|_| rows.next().unwrap_or_default());
            let first = band * TILE * width;
            split(Tiles { rows, first, width }, &fill)
        })
        .sum()
}

/// A band of rows or a part of it.
struct Tiles<'a, T> {
    rows: [&'a mut [T]; TILE],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Of the whole picture.
    width: usize,
}

impl<T> Tiles<'_, T> {
    fn columns(&self) -> usize {
        self.rows[0].len()
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
    fn for_each(mut self, mut visit: impl FnMut(usize, &mut T)) {
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
            let odd = |i: &usize| i % 2 == 1;
            let count = fill_picture(&mut out, width, || (), |(), i| i, odd);
            assert!(
                out.iter().enumerate().all(|(i, &o)| i == o),
                "{width}x{height}"
            );
            assert_eq!(count, (width * height / 2) as u64);
            out.fill(usize::MAX);
            assert_eq!(fill_list(&mut out, || (), |(), i| i, odd), count);
            assert!(out.iter().enumerate().all(|(i, &o)| i == o));
        }
    }
}
