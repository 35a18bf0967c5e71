//! What a pass over the tree goes over, and slices that it may cut in two.

use std::ops::{Index, IndexMut, Range};

/// The items that a pass goes over, by their numbers.
#[derive(Clone)]
pub(crate) enum Which<'a> {
    /// All of a range.
    All(Range<usize>),
    /// Those of a rising list.
    Listed(&'a [u32]),
}

impl Which<'_> {
    /// How many there are.
    #[inline]
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::All(range) => range.len(),
            Self::Listed(list) => list.len(),
        }
    }

    /// The number of the item in some place among them.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize) -> usize {
        match self {
            Self::All(range) => range.start + place,
            Self::Listed(list) => list[place] as usize,
        }
    }

    /// Cuts off those from item `number` on.
    pub(crate) fn split(self, number: usize) -> [Self; 2] {
        match self {
            Self::All(Range { start, end }) => [Self::All(start..number), Self::All(number..end)],
            Self::Listed(list) => {
                let place = list.partition_point(|&n| (n as usize) < number);
                let (left, right) = list.split_at(place);
                [Self::Listed(left), Self::Listed(right)]
            }
        }
    }
}

/// A slice whose items keep their numbers where it is cut.
#[derive(Debug)]
pub(crate) struct Window<'a, T> {
    first: usize,
    items: &'a mut [T],
}

impl<'a, T> Window<'a, T> {
    /// Items numbered from `first` on.
    pub(crate) fn new(first: usize, items: &'a mut [T]) -> Self {
        Self { first, items }
    }

    /// The same for a while.
    pub(crate) fn reborrow(&mut self) -> Window<'_, T> {
        Window::new(self.first, self.items)
    }

    /// Cuts off those from item `number` on.
    pub(crate) fn split(self, number: usize) -> [Self; 2] {
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
