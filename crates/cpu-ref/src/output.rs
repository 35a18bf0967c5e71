//! Results of rays, and the slices that a trace writes these to.

use geom::Hit;
use std::ops::Add;

/// The result of one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayResult {
    /// The closest hit.
    pub hit: Hit,
    /// Set if that hit is in shadow. For any-hit queries, set if the ray hits anything.
    pub blocked: bool,
}

/// Totals over some rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HitCounts {
    /// Number of closest hits.
    pub hits: u64,
    /// Number of results with [`RayResult::blocked`].
    pub blocked: u64,
}

impl Add for HitCounts {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            hits: self.hits + other.hits,
            blocked: self.blocked + other.blocked,
        }
    }
}

/// Destination of the results, one entry per ray in each slice. Slices that the query does not need are empty.
#[derive(Debug, Default)]
pub struct TraceOutput<'a> {
    closest: &'a mut [Hit],
    blocked: &'a mut [u8],
}

impl<'a> TraceOutput<'a> {
    /// Creates the output of a query. Slices that the query does not need are empty.
    pub fn new(closest: &'a mut [Hit], blocked: &'a mut [u8]) -> Self {
        Self { closest, blocked }
    }

    /// Returns the number of results.
    #[inline]
    pub fn count(&self) -> usize {
        self.closest.len().max(self.blocked.len())
    }

    /// Splits off the entries from `at` on.
    #[inline]
    #[must_use]
    pub fn split_off(&mut self, at: usize) -> Self {
        let Self { closest, blocked } = std::mem::take(self);
        let (a, b) = closest.split_at_mut(at.min(closest.len()));
        let (c, d) = blocked.split_at_mut(at.min(blocked.len()));
        *self = Self::new(a, c);
        Self::new(b, d)
    }

    /// Writes the result of one ray.
    #[inline(always)]
    pub fn set(&mut self, index: usize, result: RayResult) {
        if let Some(to) = self.closest.get_mut(index) {
            *to = result.hit;
        }
        if let Some(to) = self.blocked.get_mut(index) {
            *to = u8::from(result.blocked);
        }
    }
}
