//! Where a value stands on an axis, and which values the axis names.
//!
//! Positions are what `plotters` maps to pixels: logarithms to base ten, or ordinal numbers of names.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// A logarithmic axis covers at least so many decades.
const LEAST_DECADES: f64 = 1.0;
/// The most decades in which 2 and 5 are named too.
const FEW_DECADES: f64 = 3.5;
/// The most decades that are all named.
const MOST_DECADES: f64 = 9.0;

/// One axis.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// What it is about, unit included.
    pub(crate) title: &'static str,
    /// First and last position.
    range: [f64; 2],
    /// Positions that are named.
    ticks: Vec<(f64, String)>,
    /// Where zeros stand.
    zero: f64,
    is_log: bool,
}

impl Axis {
    /// A logarithmic axis over the positive ones of `values`, with a place below them if any is zero.
    pub(crate) fn log(title: &'static str, values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut has_zero = false;
        for value in values {
            has_zero |= value == 0.0;
            if value > 0.0 && value.is_finite() {
                (low, high) = (low.min(value.log10()), high.max(value.log10()));
            }
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let wider = (0.5 * (LEAST_DECADES - (high - low))).max(0.04 * (high - low));
        (low, high) = (low - wider, high + wider);
        let mut ticks = log_ticks(low, high);
        let zero = low - 0.08 * (high - low);
        if has_zero {
            ticks.insert(0, (zero, "none".to_owned()));
            low = zero - 0.06 * (high - low);
        }
        Self {
            title,
            range: [low, high],
            ticks,
            zero,
            is_log: true,
        }
    }

    /// One place a name, at 0, 1, 2 and so on.
    pub(crate) fn named(title: &'static str, names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<_> = (0..).map(f64::from).zip(names).collect();
        Self {
            title,
            range: [-0.5, ticks.len().max(1) as f64 - 0.5],
            ticks,
            zero: 0.0,
            is_log: false,
        }
    }

    /// Where a value stands: within the range, whatever the value.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let position = match self.is_log {
            true if value > 0.0 => value.log10(),
            true => self.zero,
            false => value,
        };
        position.clamp(low, high)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, position: &f64, pixels: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range()).map(position, pixels)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match hint.weight().allow_light_points() {
            true => Vec::new(),
            false => self.ticks.iter().map(|t| t.0).collect(),
        }
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}

impl ValueFormatter<f64> for Axis {
    /// The name of a position that has one.
    fn format_ext(&self, position: &f64) -> String {
        let found = self.ticks.iter().find(|t| t.0 == *position);
        found.map_or_else(String::new, |t| t.1.clone())
    }
}

/// 1, 2 and 5 in each of few decades, else their beginnings, or of many only some.
fn log_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let digits: &[u8] = match high - low < FEW_DECADES {
        true => &[1, 2, 5],
        false => &[1],
    };
    let step = ((high - low) / MOST_DECADES).ceil().max(1.0) as usize;
    let decades = (low.floor() as i32..=high.floor() as i32).step_by(step);
    let ticks = decades.flat_map(|e| digits.iter().map(move |d| (*d, e)));
    let at = |(d, e): (u8, i32)| (f64::from(d).log10() + f64::from(e), power(d, e));
    let within = |t: &(f64, String)| (low..=high).contains(&t.0);
    ticks.map(at).filter(within).collect()
}

/// `digit * 10^e`, in plain digits where they are few.
fn power(digit: u8, e: i32) -> String {
    let scientific = format!("{digit}e{e}");
    match scientific.parse::<f64>() {
        Ok(value) if (-3..6).contains(&e) => value.to_string(),
        _ => scientific,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn names(values: &[f64]) -> Vec<String> {
        let axis = Axis::log("", values.iter().copied());
        axis.ticks.into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn a_logarithmic_axis_names_round_values() {
        assert_eq!(names(&[0.9, 12.0]), ["1", "2", "5", "10"]);
        assert_eq!(
            names(&[0.0, 0.001, 999.0]),
            ["none", "0.001", "0.01", "0.1", "1", "10", "100", "1000"]
        );
        assert_eq!(
            names(&[1e-9, 1e-5]),
            ["1e-9", "1e-8", "1e-7", "1e-6", "1e-5"]
        );
    }

    #[test]
    fn zeros_stand_below_every_value() {
        let axis = Axis::log("", [1.0, 0.0, 100.0]);
        assert!(axis.range[0] < axis.at(0.0) && axis.at(0.0) < axis.at(1.0) - 0.1);
        assert_eq!(axis.format_ext(&axis.at(0.0)), "none");
    }

    proptest! {
        #[test]
        fn any_values_give_a_finite_axis_with_few_names(
            values in prop::collection::vec(any::<f64>(), 0..6)
        ) {
            let axis = Axis::log("", values.clone());
            let [low, high] = axis.range;
            prop_assert!(low < high && (2..=13).contains(&axis.ticks.len()), "{axis:?}");
            for v in values.iter().copied().chain([0.0, f64::NAN, f64::INFINITY]) {
                prop_assert!((low..=high).contains(&axis.at(v)));
            }
        }
    }
}
