//! What was counted, held against what is expected.

use crate::stress::baseline::{is_never, known};
use crate::stress::bounds::interval;
use crate::stress::{Family, StressCounts};
use backend::{Arithmetic, Intersector};

named! {
    /// What is counted.
    pub enum Measure {
        /// Answers that are not the exact ones.
        Wrong = "wrong",
        /// Rays from inside that meet nothing.
        Leaks = "leaks",
        /// Rays that cross a body too often or not often enough.
        DoubleHits = "double_hits",
        /// Answers that differ with the tree.
        TreeDependent = "tree_dependent",
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
    /// See [`crate::stress::Rearranged::sah_ratio`].
    pub sah_ratio: Option<f64>,
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
    /// Holds a tally against what is expected of an intersector on a device of that arithmetic.
    #[must_use]
    pub fn new(
        family: Family,
        intersector: Intersector,
        tally: &StressCounts,
        arithmetic: Arithmetic,
    ) -> Self {
        let mut counts = vec![(Measure::Wrong, tally.wrong, tally.rays)];
        if let Some(c) = tally.closed {
            counts.push((Measure::Leaks, c.leaks, c.inside));
            counts.push((Measure::DoubleHits, c.doubles, c.counted));
        }
        if let Some(r) = tally.rearranged {
            counts.push((Measure::TreeDependent, r.dependent, tally.rays));
        }
        let measured = counts.into_iter().map(|(measure, count, of)| Measured {
            measure,
            count,
            of,
            bound: bound((family, intersector, measure), of, arithmetic),
        });
        Self {
            family,
            intersector,
            measured: measured.collect(),
            sah_ratio: tally.rearranged.and_then(|r| r.sah_ratio),
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

fn bound(
    (family, by, measure): (Family, Intersector, Measure),
    of: u64,
    arithmetic: Arithmetic,
) -> Option<[f64; 2]> {
    if is_never(by, measure) {
        return Some([0.0; 2]);
    }
    known(family, by, measure, arithmetic).map(|k| interval(k, of))
}
