//! A few rays, no more than a packet holds.

use super::cell::Cell;
use super::together::MOST_RAYS;
use crate::trace::ray;
use backend::Rays;
use geom::Ray;

/// Rays by their numbers.
pub(super) struct Few {
    indices: [usize; MOST_RAYS],
    /// A bit for each lane that holds one.
    pub(super) asked: u32,
}

/// Cannot hit anything.
const NO_RAY: Ray = Ray {
    origin: [0.0; 3],
    t_min: 0.0,
    direction: [0.0; 3],
    t_max: 0.0,
};

impl Few {
    /// Neighbours in a list.
    #[inline(always)]
    pub(super) fn row(first: usize, count: usize) -> Self {
        let mut indices = [0; MOST_RAYS];
        for (lane, index) in indices.iter_mut().enumerate() {
            *index = first + lane;
        }
        let asked = (1 << count) - 1;
        Self { indices, asked }
    }

    /// Neighbours in a picture.
    #[inline(always)]
    pub(super) fn of(cell: &Cell) -> Self {
        let mut indices = [0; MOST_RAYS];
        for (lane, index) in indices.iter_mut().enumerate().take(cell.lanes) {
            *index = cell.index(lane);
        }
        let asked = cell.asked;
        Self { indices, asked }
    }

    /// The number of a lane's ray.
    pub(super) fn index(&self, lane: usize) -> usize {
        self.indices[lane]
    }

    /// One a lane.
    #[inline(always)]
    pub(super) fn rays(&self, of: Rays<'_>) -> [Ray; MOST_RAYS] {
        let mut rays = [NO_RAY; MOST_RAYS];
        for (lane, to) in rays.iter_mut().enumerate() {
            if self.asked >> lane & 1 == 1 {
                *to = ray(of, self.indices[lane]);
            }
        }
        rays
    }
}
