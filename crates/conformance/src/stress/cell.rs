//! What was counted, held against what is expected.

use crate::stress::Family;
use crate::stress::baseline::{is_never, known};
use crate::stress::bounds::interval;
use backend::{Arithmetic, Intersector};

backend::named! {
    /// What is counted.
    pub enum Measure {
        /// Answers that are not the exact ones.
        Wrong = "wrong",
        /// Rays from inside that meet nothing.
        Leaks = "leaks",
        /// Rays that cross a body too often or not often enough.
        DoubleHits = "double_hits",
    }
}

/// A count with its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// What was counted.
    pub measure: Measure,
    /// How many.
    pub count: u64,
    /// Of how many rays.
    pub of: u64,
    /// The rates to be expected; `None` if nobody ever measured this.
    pub bound: Option<[f64; 2]>,
}

/// One family by one intersector.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The family.
    pub family: Family,
    /// The intersector.
    pub intersector: Intersector,
    /// What was counted, wrong answers first.
    pub measured: Vec<Measured>,
}

impl Measured {
    /// How often; 0 of no rays at all.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.count as f64 / self.of.max(1) as f64
    }

    /// Whether the rate is within its bound. Of no rays nothing is known.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&self.rate());
        self.of == 0 || self.bound.is_some_and(within)
    }
}

impl Cell {
    /// Holds counts, each with its number of rays, against what is expected of an intersector on a device of that
    /// arithmetic. Wrong answers come first.
    #[must_use]
    pub fn new(
        family: Family,
        intersector: Intersector,
        counts: &[(Measure, u64, u64)],
        arithmetic: Arithmetic,
    ) -> Self {
        let measured = counts.iter().map(|&(measure, count, of)| {
            let bound = match is_never(intersector, measure) {
                true => Some([0.0; 2]),
                false => known(family, intersector, measure, arithmetic).map(|k| interval(k, of)),
            };
            Measured {
                measure,
                count,
                of,
                bound,
            }
        });
        Self {
            family,
            intersector,
            measured: measured.collect(),
        }
    }

    /// Wrong answers.
    #[must_use]
    pub fn wrong(&self) -> &Measured {
        &self.measured[0]
    }

    /// What was counted of one thing; `None` if it means nothing in this family.
    #[must_use]
    pub fn get(&self, measure: Measure) -> Option<&Measured> {
        self.measured.iter().find(|m| m.measure == measure)
    }

    /// Whether every rate is within its bound.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.measured.iter().all(Measured::is_ok)
    }
}
