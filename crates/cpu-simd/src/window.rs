//! Parts of slices for parallel tasks.

use std::ops::{Index, IndexMut};

/// Part of a slice, with the indices of the whole slice.
#[derive(Debug)]
pub(crate) struct Window<'a, T> {
    first: usize,
    items: &'a mut [T],
}

impl<'a, T> Window<'a, T> {
    /// Creates a window whose first item has index `first`.
    pub(crate) fn new(first: usize, items: &'a mut [T]) -> Self {
        Self { first, items }
    }

    /// Borrows the window for a shorter lifetime.
    pub(crate) fn reborrow(&mut self) -> Window<'_, T> {
        Window::new(self.first, self.items)
    }

    /// Splits off the items from index `number` on.
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
