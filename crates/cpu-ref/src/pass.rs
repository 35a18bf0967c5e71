//! Parallel passes over many items: over a range or over a list of indices.

use std::ops::{Add, Index, IndexMut, Range};

/// The indices of the items that a pass processes.
#[derive(Clone)]
pub enum Which<'a> {
    /// All items of a range.
    All(Range<usize>),
    /// The items of an ascending list.
    Listed(&'a [u32]),
}

impl Which<'_> {
    /// Returns the number of items.
    #[inline]
    pub fn count(&self) -> usize {
        match self {
            Self::All(range) => range.len(),
            Self::Listed(list) => list.len(),
        }
    }

    /// Returns the index of the item at position `place`.
    #[inline(always)]
    pub fn at(&self, place: usize) -> usize {
        match self {
            Self::All(range) => range.start + place,
            Self::Listed(list) => list[place] as usize,
        }
    }

    /// Splits off the items from index `number` on.
    #[must_use]
    pub fn split_before(self, number: usize) -> [Self; 2] {
        let place = match &self {
            Self::All(range) => number - range.start,
            Self::Listed(list) => list.partition_point(|&n| (n as usize) < number),
        };
        self.split(place)
    }

    fn split(self, place: usize) -> [Self; 2] {
        match self {
            Self::All(Range { start, end }) => {
                let middle = start + place;
                [Self::All(start..middle), Self::All(middle..end)]
            }
            Self::Listed(list) => {
                let (left, right) = list.split_at(place);
                [Self::Listed(left), Self::Listed(right)]
            }
        }
    }
}

/// The output of a pass, which can be split among parallel tasks.
pub trait SplitAt: Send + Sized {
    /// Splits off everything from item `number` on.
    fn split(self, number: usize) -> [Self; 2];

    /// Returns whether two neighbouring items must stay in one part. No more than two in a row may be joined.
    fn joins(&self, _left: usize, _right: usize) -> bool {
        false
    }
}

/// Part of a slice, with the indices of the whole slice.
#[derive(Debug)]
pub struct Window<'a, T> {
    first: usize,
    items: &'a mut [T],
}

impl<'a, T> Window<'a, T> {
    /// Creates a window on items numbered from `first` on.
    pub fn new(first: usize, items: &'a mut [T]) -> Self {
        Self { first, items }
    }

    /// Borrows the window for a shorter lifetime.
    pub fn reborrow(&mut self) -> Window<'_, T> {
        Window::new(self.first, self.items)
    }

    /// Returns the items of a range of indices.
    #[inline]
    pub fn slice(&mut self, numbers: Range<usize>) -> &mut [T] {
        &mut self.items[numbers.start - self.first..numbers.end - self.first]
    }
}

impl<T: Send> SplitAt for Window<'_, T> {
    fn split(self, number: usize) -> [Self; 2] {
        let (left, right) = self.items.split_at_mut(number - self.first);
        [Self::new(self.first, left), Self::new(number, right)]
    }
}

impl<T> Index<usize> for Window<'_, T> {
    type Output = T;

    #[inline(always)]
    fn index(&self, number: usize) -> &T {
        &self.items[number - self.first]
    }
}

impl<T> IndexMut<usize> for Window<'_, T> {
    #[inline(always)]
    fn index_mut(&mut self, number: usize) -> &mut T {
        &mut self.items[number - self.first]
    }
}

/// Runs `task` in parallel on at most `run` items each and sums the results, in the same order for every number of
/// threads.
pub fn pass<P: SplitAt, S: Add<Output = S> + Send>(
    which: Which<'_>,
    part: P,
    run: usize,
    task: &(impl Fn(Which<'_>, P) -> S + Sync),
) -> S {
    if which.count() <= run {
        return task(which, part);
    }
    let half = which.count() / 2;
    let half = half + usize::from(part.joins(which.at(half - 1), which.at(half)));
    let parts = part.split(which.at(half));
    let ([left, right], [left_part, right_part]) = (which.split(half), parts);
    let (a, b) = rayon::join(
        || pass(left, left_part, run, task),
        || pass(right, right_part, run, task),
    );
    a + b
}
