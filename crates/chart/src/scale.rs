//! Where a value stands on an axis, and which values the axis names.
//!
//! Positions are what `plotters` maps to pixels: logarithms to base ten, plain
//! values, or ordinal numbers.

use crate::text::{number, superscript};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// One axis.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    kind: Kind,
    /// First and last position.
    pub(crate) range: (f64, f64),
    /// Positions that are named.
    pub(crate) ticks: Vec<(f64, String)>,
    /// Where zeros stand on a logarithmic axis that has a place for them.
    pub(crate) rail: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Log,
    Plain,
}

/// A logarithmic axis covers at least this many decades.
const LEAST_DECADES: f64 = 0.6;
/// What an axis covers before its place for zeros, as a share of the gap after it.
const MARGIN: f64 = 0.75;

impl Scale {
    /// A logarithmic axis over the positive ones of `values`, with at most `most` names (3 or more).
    pub(crate) fn log(values: impl IntoIterator<Item = f64>, most: usize) -> Self {
        let (mut low, mut high) =
            extent(values.into_iter().filter(|&x| x > 0.0).map(f64::log10)).unwrap_or((0.0, 1.0));
        let lacking = LEAST_DECADES - (high - low);
        if lacking > 0.0 {
            (low, high) = (low - lacking / 2.0, high + lacking / 2.0);
        }
        let margin = 0.05 * (high - low);
        let range = (low - margin, high + margin);
        Self {
            kind: Kind::Log,
            range,
            ticks: log_ticks(range, most),
            rail: None,
        }
    }

    /// The same with a place for zeros before its first value.
    pub(crate) fn with_rail(mut self, name: &str) -> Self {
        let gap = 0.13 * (self.range.1 - self.range.0);
        let rail = self.range.0 - gap;
        self.range.0 = rail - MARGIN * gap;
        self.ticks.insert(0, (rail, name.to_owned()));
        self.rail = Some(rail);
        self
    }

    /// The same without names so near the place for zeros that they would run into its own.
    pub(crate) fn with_free_rail(mut self) -> Self {
        if let Some(rail) = self.rail {
            let gap = (rail - self.range.0) / MARGIN;
            self.ticks.retain(|t| t.0 == rail || t.0 - rail > 1.5 * gap);
        }
        self
    }

    /// A plain axis from zero to beyond the largest of `values`, with room for words there, with at most `most + 1` names (3 or more).
    pub(crate) fn from_zero(values: impl IntoIterator<Item = f64>, most: usize) -> Self {
        let high = extent(values).map_or(1.0, |(_, high)| if high > 0.0 { high } else { 1.0 });
        let high = high.clamp(1e-300, 1e300);
        let range = (0.0, high * 1.3);
        let step = round_step(range.1 / most as f64);
        let ticks = (0..=most)
            .map(|i| i as f64 * step)
            .filter(|&x| x <= range.1)
            .map(|x| (x, plain(x, step)))
            .collect();
        Self {
            kind: Kind::Plain,
            range,
            ticks,
            rail: None,
        }
    }

    /// One place a name, at 0, 1, 2 and so on, with half a step of margin.
    pub(crate) fn named(names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<_> = (0..).map(f64::from).zip(names).collect();
        Self {
            kind: Kind::Plain,
            range: (-0.5, ticks.len().max(1) as f64 - 0.5),
            ticks,
            rail: None,
        }
    }

    /// The same from the last to the first: downwards on a vertical axis.
    pub(crate) fn reversed(mut self) -> Self {
        self.range = (self.range.1, self.range.0);
        self
    }

    /// Where a value stands: within the range, whatever the value.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let (low, high) = (
            self.range.0.min(self.range.1),
            self.range.0.max(self.range.1),
        );
        let position = match self.kind {
            Kind::Log if value > 0.0 => value.log10(),
            Kind::Log => self.rail.unwrap_or(low),
            Kind::Plain => value,
        };
        if position.is_nan() {
            low
        } else {
            position.clamp(low, high)
        }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, position: &f64, pixels: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range()).map(position, pixels)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.iter().map(|t| t.0).collect()
    }

    fn range(&self) -> Range<f64> {
        self.range.0..self.range.1
    }
}

impl ValueFormatter<f64> for Scale {
    /// The name of a position that has one.
    fn format_ext(&self, position: &f64) -> String {
        let found = self.ticks.iter().find(|t| t.0 == *position);
        found.map_or_else(String::new, |t| t.1.clone())
    }
}

fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|x| x.is_finite());
    finite.fold(None, |range, x| match range {
        None => Some((x, x)),
        Some((low, high)) => Some((x.min(low), x.max(high))),
    })
}

/// Digits that are named in each decade, the most telling choice that is not too many.
fn log_ticks((low, high): (f64, f64), most: usize) -> Vec<(f64, String)> {
    let choices: [&[f64]; 4] = [
        &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        &[1.0, 2.0, 5.0],
        &[1.0, 3.0],
        &[1.0],
    ];
    let decades = low.floor() as i32..=high.ceil() as i32;
    let ticks = |digits: &[f64], step: usize| -> Vec<_> {
        let of = |e: i32| {
            digits
                .iter()
                .map(move |&d| (d.log10() + f64::from(e), d, e))
        };
        let all = decades
            .clone()
            .filter(|e| e.rem_euclid(step as i32) == 0)
            .flat_map(of);
        all.filter(|t| (low..=high).contains(&t.0))
            .map(|(at, digit, e)| (at, power(digit, e)))
            .collect()
    };
    // Few names if they are long.
    let fits = |t: &Vec<(f64, String)>| {
        let longest = t.iter().map(|t| t.1.chars().count()).max().unwrap_or(0);
        t.len() <= most && t.len() * longest <= 5 * most
    };
    let dense = choices.iter().map(|digits| ticks(digits, 1)).find(fits);
    dense.unwrap_or_else(|| ticks(&[1.0], decades.clone().count().div_ceil(most.max(1))))
}

/// `digit * 10^e` in plain digits where they are few.
fn power(digit: f64, e: i32) -> String {
    let fraction = usize::from(digit.fract() != 0.0);
    match e {
        0..4 => format!("{}", digit * 10f64.powi(e)),
        -3..0 => format!(
            "{:.*}",
            fraction + e.unsigned_abs() as usize,
            digit * 10f64.powi(e)
        ),
        _ if digit == 1.0 => format!("10{}", superscript(&e.to_string())),
        _ => format!("{digit}×10{}", superscript(&e.to_string())),
    }
}

/// The least of 1, 2, 5 times a power of ten that is not below `x`.
fn round_step(x: f64) -> f64 {
    let unit = 10f64.powf(x.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|d| d * unit);
    steps.into_iter().find(|&s| s >= x).unwrap_or(10.0 * unit)
}

fn plain(x: f64, step: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&step) {
        return number(x);
    }
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    format!("{x:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn names(scale: &Scale) -> Vec<&str> {
        scale.ticks.iter().map(|t| &*t.1).collect()
    }

    #[test]
    fn a_logarithmic_axis_names_round_values() {
        assert_eq!(names(&Scale::log([0.9, 12.0], 6)), ["1", "2", "5", "10"]);
        assert_eq!(
            names(&Scale::log([0.001, 999.0], 7)),
            ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]
        );
        assert_eq!(
            names(&Scale::log([1e-7, 1e-5], 4)),
            ["10⁻⁷", "10⁻⁶", "10⁻⁵"]
        );
        assert_eq!(names(&Scale::from_zero([410.0], 5)), ["0", "200", "400"]);
    }

    #[test]
    fn zeros_stand_on_the_rail_below_every_value() {
        let scale = Scale::log([1.0, 100.0], 5).with_rail("none");
        assert_eq!(Some(scale.at(0.0)), scale.rail);
        assert!(scale.range.0 < scale.at(0.0) && scale.at(0.0) < scale.at(1.0) - 0.1);
        assert_eq!(scale.format_ext(&scale.at(0.0)), "none");
    }

    proptest! {
        #[test]
        fn any_values_give_a_finite_axis_with_few_names(
            values in prop::collection::vec(any::<f64>(), 0..6), most in 3usize..9
        ) {
            for scale in [
                Scale::log(values.clone(), most).with_rail("none"),
                Scale::from_zero(values.clone(), most),
            ] {
                prop_assert!(scale.range.0 < scale.range.1, "{scale:?}");
                prop_assert!(scale.ticks.len() <= most + 1 && scale.ticks.len() >= 2, "{scale:?}");
                for v in values.iter().copied().chain([0.0, f64::NAN, f64::INFINITY]) {
                    let at = scale.at(v);
                    prop_assert!(at >= scale.range.0 && at <= scale.range.1);
                }
            }
        }
    }
}
