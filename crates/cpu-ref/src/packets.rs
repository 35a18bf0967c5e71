//! Fills pictures and lists in parallel, packet by packet, so that neighbouring rays run together.

use std::ops::Add;

/// Rows of a band, and columns of a packet.
const PACKET: usize = 8;
/// Packets that one task handles.
const PACKETS: usize = 8;
/// Entries of a list that one task handles.
const RUN: usize = 256;

/// What is filled: a slice, or two of one length.
pub(crate) trait Sink: Default + Send {
    /// What stands in one place, in all slices together.
    type Entry;

    fn size(&self) -> usize;
    fn split(self, at: usize) -> (Self, Self);
    fn set(&mut self, index: usize, entry: Self::Entry);
}

impl<T: Send> Sink for &mut [T] {
    type Entry = T;

    #[inline(always)]
    fn size(&self) -> usize {
        self.len()
    }
    #[inline]
    fn split(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
    #[inline(always)]
    fn set(&mut self, index: usize, entry: T) {
        self[index] = entry;
    }
}

impl<A: Send, B: Send> Sink for (&mut [A], &mut [B]) {
    type Entry = (A, B);

    #[inline(always)]
    fn size(&self) -> usize {
        self.0.len()
    }
    #[inline]
    fn split(self, at: usize) -> (Self, Self) {
        let (a, b) = (self.0.split_at_mut(at), self.1.split_at_mut(at));
        ((a.0, b.0), (a.1, b.1))
    }
    #[inline(always)]
    fn set(&mut self, index: usize, entry: (A, B)) {
        self.0[index] = entry.0;
        self.1[index] = entry.1;
    }
}

/// Hands `task` neighbouring entries of a list and the index of the first, until it saw all. Sums what it returns.
pub(crate) fn fill_list<O: Sink, S: Add<Output = S> + Send>(
    out: O,
    task: impl Fn(usize, O) -> S + Sync,
) -> S {
    split_list((0, out), &task)
}

/// Halves a list until it is short.
fn split_list<O: Sink, S: Add<Output = S> + Send>(
    (first, out): (usize, O),
    task: &(impl Fn(usize, O) -> S + Sync),
) -> S {
    if out.size() <= RUN {
        return task(first, out);
    }
    let half = (out.size() / 2).next_multiple_of(RUN);
    let (left, right) = out.split(half);
    let left = || split_list((first, left), task);
    let (a, b) = rayon::join(left, || split_list((first + half, right), task));
    a + b
}

/// As [`fill_list`], for a picture of rows `width` entries wide, in neighbouring packets.
pub(crate) fn fill_picture<O: Sink, S: Add<Output = S> + Send>(
    out: O,
    width: usize,
    task: impl Fn(Packets<O>) -> S + Sync,
) -> S {
    split_rows((0, out), width, &task)
}

/// Halves a picture until it is one band of rows.
fn split_rows<O: Sink, S: Add<Output = S> + Send>(
    (first, out): (usize, O),
    width: usize,
    task: &(impl Fn(Packets<O>) -> S + Sync),
) -> S {
    let count = out.size() / width;
    if count <= PACKET {
        let mut rest = out;
        let rows = std::array::from_fn(|_| {
            let at = width.min(rest.size());
            let (row, below) = std::mem::take(&mut rest).split(at);
            rest = below;
            row
        });
        return split_band(Packets { rows, first, width }, task);
    }
    let half = (count / 2).next_multiple_of(PACKET) * width;
    let (upper, lower) = out.split(half);
    let upper = || split_rows((first, upper), width, task);
    let (a, b) = rayon::join(upper, || split_rows((first + half, lower), width, task));
    a + b
}

/// Halves a band until few packets are left.
fn split_band<O: Sink, S: Add<Output = S> + Send>(
    packets: Packets<O>,
    task: &(impl Fn(Packets<O>) -> S + Sync),
) -> S {
    if packets.columns() <= PACKET * PACKETS {
        return task(packets);
    }
    let half = (packets.columns() / 2).next_multiple_of(PACKET);
    let (left, right) = packets.split_at(half);
    let (a, b) = rayon::join(|| split_band(left, task), || split_band(right, task));
    a + b
}

/// A band of rows or a part of it.
pub(crate) struct Packets<O> {
    rows: [O; PACKET],
    /// Index in the picture of the first entry of the first row.
    first: usize,
    /// Of the whole picture.
    width: usize,
}

impl<O: Sink> Packets<O> {
    pub(crate) fn columns(&self) -> usize {
        self.rows[0].size()
    }

    /// Rows that reach into the picture.
    #[inline]
    pub(crate) fn height(&self) -> usize {
        self.rows.iter().filter(|row| row.size() > 0).count()
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

    #[inline(always)]
    pub(crate) fn set(&mut self, x: usize, y: usize, entry: O::Entry) {
        self.rows[y].set(x, entry);
    }

    /// Cuts off the columns from `column` on.
    fn split_at(self, column: usize) -> (Self, Self) {
        let (first, width) = (self.first, self.width);
        let mut right: [O; PACKET] = std::array::from_fn(|_| O::default());
        let mut cut = right.iter_mut();
        let rows = self.rows.map(|row| {
            let at = column.min(row.size());
            let (a, b) = row.split(at);
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

    /// Fills every entry from its index, packet after packet.
    #[inline]
    pub(crate) fn fill(mut self, mut entry: impl FnMut(usize) -> O::Entry) {
        for column in (0..self.columns()).step_by(PACKET) {
            for (y, row) in self.rows.iter_mut().enumerate() {
                for x in column..row.size().min(column + PACKET) {
                    row.set(x, entry(self.first + y * self.width + x));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_made_from_its_own_index() {
        for (width, height) in [(1, 1), (7, 3), (64, 8), (65, 9), (1000, 17)] {
            let (mut out, mut twice) = (vec![usize::MAX; width * height], vec![0; width * height]);
            let count = fill_picture((&mut out[..], &mut twice[..]), width, |packets| {
                let mut odd = 0;
                packets.fill(|i| {
                    odd += (i % 2) as u64;
                    (i, 2 * i)
                });
                odd
            });
            let own = |(i, (&o, &t)): (usize, (&usize, &usize))| i == o && 2 * i == t;
            assert!(
                out.iter().zip(&twice).enumerate().all(own),
                "{width}x{height}"
            );
            assert_eq!(count, (width * height / 2) as u64);
            out.fill(usize::MAX);
            let made = fill_list(&mut out[..], |first, out| {
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
