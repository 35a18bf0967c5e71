//! Counts of a stability test, compared with bounds that allow for chance.
//!
//! Let `p` be the true rate and `q` another rate. In `n` independent rays, the probability of a rate at least as far
//! from `p` as `q`, on the same side, is at most `exp(-n KL(q, p))`. Here `KL` is the Kullback-Leibler divergence of
//! two Bernoulli distributions (Chernoff 1952).
//!
//! Rays of one scene are not independent. So `n` is divided by the spread: the variance of the rate among seeds,
//! divided by that of independent rays. The baseline also comes from a sample, so the same bound yields an interval
//! for `p`.

use crate::stability::Family;
use crate::stability::baseline::{RateEntry, is_never, known};
use backend::{Arithmetic, Intersector};

backend::named! {
    /// Counted event.
    pub enum Measure {
        /// Hits whose triangle differs from the exact one.
        Wrong = "wrong",
        /// Rays from inside that miss.
        Leaks = "leaks",
        /// Rays from inside that cross a body an even number of times, or rays from outside an odd number of times.
        /// Rays that leak through a gap also have a wrong number of crossings, so they are counted too.
        DoubleHits = "double_hits",
    }
}

/// A count of one event, with its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredRate {
    /// The counted event.
    pub measure: Measure,
    /// Number of events.
    pub count: u64,
    /// Number of rays in which the event can occur: for leaks, only rays from inside.
    pub of: u64,
    /// Bounds of the rate, or `None` if they are not known.
    pub bound: Option<[f64; 2]>,
}

/// Results of one family and one intersector.
#[derive(Clone, Debug, PartialEq)]
pub struct StabilityCell {
    /// The family.
    pub family: Family,
    /// The intersector.
    pub intersector: Intersector,
    /// Counts, wrong answers first.
    pub measured: Vec<MeasuredRate>,
}

impl MeasuredRate {
    /// Returns `count` events in `of` rays, without bounds.
    pub fn new(measure: Measure, count: u64, of: u64) -> Self {
        Self {
            measure,
            count,
            of,
            bound: None,
        }
    }

    /// Returns the rate; 0 if there are no rays.
    pub fn rate(&self) -> f64 {
        self.count as f64 / self.of.max(1) as f64
    }

    /// Returns whether the rate is within its bounds, or there are no rays.
    pub fn is_ok(&self) -> bool {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&self.rate());
        self.of == 0 || self.bound.is_some_and(within)
    }
}

impl StabilityCell {
    /// Creates a cell, and sets the bounds of its counts for a device with this arithmetic.
    ///
    /// Wrong answers must be the first count.
    pub fn new(
        family: Family,
        intersector: Intersector,
        mut measured: Vec<MeasuredRate>,
        arithmetic: Arithmetic,
    ) -> Self {
        for m in &mut measured {
            m.bound = if is_never(intersector, m.measure) {
                Some([0.0; 2])
            } else {
                known(family, intersector, m.measure, arithmetic).map(|k| interval(k, m.of))
            };
        }
        Self {
            family,
            intersector,
            measured,
        }
    }

    /// Returns the count of wrong answers.
    pub fn wrong(&self) -> &MeasuredRate {
        &self.measured[0]
    }

    /// Returns the count of one event, or `None` if this cell does not count it.
    pub fn get(&self, measure: Measure) -> Option<&MeasuredRate> {
        self.measured.iter().find(|m| m.measure == measure)
    }

    /// Returns whether every rate is within its bounds.
    pub fn is_ok(&self) -> bool {
        self.measured.iter().all(MeasuredRate::is_ok)
    }
}

/// Negative logarithm of the probability of a rate out of bounds. `exp(-18)`, less than `2e-8`, corresponds to six
/// standard deviations by Chernoff's bound.
const LIMIT: f64 = 18.0;
/// Number of bisection steps. They suffice for the precision of an `f64`.
const STEPS: u32 = 60;

/// Returns the bounds of the rate in `rays` rays.
fn interval(known: &RateEntry, rays: u64) -> [f64; 2] {
    let rate = known.count as f64 / known.of.max(1) as f64;
    let true_limit = LIMIT * known.spread / known.of.max(1) as f64;
    let observed_limit = LIMIT * known.spread / (rays as f64).max(1.0);
    // First the bounds of the true rate, then those of the observed rate.
    let least = edge(rate, 0.0, |p| divergence(rate, p) <= true_limit);
    let most = edge(rate, 1.0, |p| divergence(rate, p) <= true_limit);
    [
        edge(least, 0.0, |q| divergence(q, least) <= observed_limit),
        edge(most, 1.0, |q| divergence(q, most) <= observed_limit),
    ]
}

/// Returns the last point between `from` and `to` at which `holds` is true, by bisection. It must be true at `from`.
fn edge(from: f64, to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(to) {
        return to;
    }
    let (mut inner, mut outer) = (from, to);
    for _ in 0..STEPS {
        let middle = f64::midpoint(inner, outer);
        if holds(middle) {
            inner = middle;
        } else {
            outer = middle;
        }
    }
    inner
}

/// Returns the Kullback-Leibler divergence `KL(q, p)` of two Bernoulli distributions, in nats.
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
    fn bounds_are_tight_confidence_intervals() {
        let [low, high] = interval(&known(0.25, 1.0), 10_000);
        // The standard deviation is 0.0043, and 0.0004 for the known rate.
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
    fn bounds_handle_rates_zero_and_one() {
        let [low, high] = interval(&known(0.0, 1.0), 8192);
        assert!(low == 0.0 && (5e-4..1e-3).contains(&high), "{high}");
        let [low, high] = interval(&known(1.0, 1.0), 8192);
        assert!(high == 1.0 && (0.999..0.9995).contains(&low), "{low}");
        assert_eq!(interval(&known(0.5, 1.0), 0), [0.0, 1.0]);
    }
}
