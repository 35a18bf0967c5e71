//! What was counted, held against what chance allows.
//!
//! A rate `q` seen in `n` independent rays is further from the true rate `p` than this with a probability of at most
//! `exp(-n KL(q, p))` on either side (Chernoff 1952; `KL` is the divergence of two coins). Rays of one scene are not
//! independent: `n` is divided by the spread, the variance of the rate among seeds over that of as many independent rays. The
//! true rate is known from a baseline, within the same limits.

use crate::stress::Family;
use crate::stress::baseline::{RateEntry, is_never, known};
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
    pub fn rate(&self) -> f64 {
        self.count as f64 / self.of.max(1) as f64
    }

    /// Whether the rate is within its bound. Of no rays nothing is known.
    pub fn is_ok(&self) -> bool {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&self.rate());
        self.of == 0 || self.bound.is_some_and(within)
    }
}

impl Cell {
    /// Holds counts, each with its number of rays, against what is expected of an intersector on a device of that
    /// arithmetic. Wrong answers come first.
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
    pub fn wrong(&self) -> &Measured {
        &self.measured[0]
    }

    /// What was counted of one thing; `None` if it means nothing in this family.
    pub fn get(&self, measure: Measure) -> Option<&Measured> {
        self.measured.iter().find(|m| m.measure == measure)
    }

    /// Whether every rate is within its bound.
    pub fn is_ok(&self) -> bool {
        self.measured.iter().all(Measured::is_ok)
    }
}

/// Improbability at which a rate is out of bounds: `exp(-18)`, less than `2e-8`, that of six standard deviations by
/// Chernoff's bound.
const LIMIT: f64 = 18.0;
/// Steps of bisection, down to the precision of a rate.
const STEPS: u32 = 60;

/// The rates to be expected of `rays` rays.
fn interval(known: &RateEntry, rays: u64) -> [f64; 2] {
    let rate = known.count as f64 / known.of.max(1) as f64;
    let before = LIMIT * known.spread / known.of.max(1) as f64;
    let now = LIMIT * known.spread / (rays as f64).max(1.0);
    // The true rate, then what may be seen of it.
    let least = edge(rate, 0.0, |p| divergence(rate, p) <= before);
    let most = edge(rate, 1.0, |p| divergence(rate, p) <= before);
    [
        edge(least, 0.0, |q| divergence(q, least) <= now),
        edge(most, 1.0, |q| divergence(q, most) <= now),
    ]
}

/// The place between `from`, where `holds`, and `to`, where it perhaps does not, up to which it does.
fn edge(from: f64, to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(to) {
        return to;
    }
    let (mut inner, mut outer) = (from, to);
    for _ in 0..STEPS {
        let middle = f64::midpoint(inner, outer);
        match holds(middle) {
            true => inner = middle,
            false => outer = middle,
        }
    }
    inner
}

/// `KL(q, p)` of two coins, in nats.
fn divergence(q: f64, p: f64) -> f64 {
    let term = |q: f64, p: f64| if q == 0.0 { 0.0 } else { q * (q / p).ln() };
    term(q, p) + term(1.0 - q, 1.0 - p)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(rate: f64, spread: f64) -> RateEntry {
        RateEntry {
            count: (rate * 1e6) as u64,
            of: 1_000_000,
            spread,
            ..RateEntry::default()
        }
    }

    #[test]
    fn bounds_hold_what_chance_brings_and_little_more() {
        let [low, high] = interval(&known(0.25, 1.0), 10_000);
        // A standard deviation is 0.0043, and 0.0004 of what is known.
        assert!((0.220..0.226).contains(&low), "{low}");
        assert!((0.274..0.280).contains(&high), "{high}");
        let width = |spread, rays| {
            let [low, high] = interval(&known(0.1, spread), rays);
            high - low
        };
        assert!(width(1.0, 10_000) < width(1.0, 1000));
        assert!(width(4.0, 10_000) > 1.5 * width(1.0, 10_000));
    }

    #[test]
    fn never_and_always_have_an_end_of_their_own() {
        let [low, high] = interval(&known(0.0, 1.0), 8192);
        assert!(low == 0.0 && (5e-4..1e-3).contains(&high), "{high}");
        let [low, high] = interval(&known(1.0, 1.0), 8192);
        assert!(high == 1.0 && (0.999..0.9995).contains(&low), "{low}");
        assert_eq!(interval(&known(0.5, 1.0), 0), [0.0, 1.0]);
    }
}
