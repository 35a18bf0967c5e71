//! Measured rates for each kind of arithmetic: one per intersector, family and measure.
//!
//! `watertight` and `exact` have the same answers everywhere, so the host's rates apply. The rates of all other
//! intersectors depend on the device's [`Arithmetic`]. A file in `baselines` contains the rates of one kind of
//! arithmetic and where they were measured (`ground`). `abvh stability --record FILE` writes one from a device's
//! answers to many seeds. To use it, add it to that folder and to `FILES`. Files omit events that must never happen:
//! see `is_never`.

use crate::stability::{Family, Measure, MeasuredRate, Plan, StabilityCell, StabilityTest};
use backend::{Arithmetic, Backend, Intersector, Result};
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// One file per kind of arithmetic.
const FILES: [&str; 2] = [
    include_str!("baselines/host.json"),
    include_str!("baselines/nvidia.json"),
];

/// Rates measured with one kind of arithmetic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// The arithmetic.
    pub arithmetic: Arithmetic,
    /// Device, driver and settings of the measurement.
    #[serde(rename = "ground")]
    pub measured_on: String,
    /// Measured rates.
    pub entries: Vec<RateEntry>,
}

/// A rate over many seeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RateEntry {
    /// Name of the family.
    pub family: String,
    /// Name of the intersector.
    pub intersector: String,
    /// Name of the measure.
    pub measure: String,
    /// Number of counted events over all seeds.
    pub count: u64,
    /// Sum of [`MeasuredRate::of`] over all seeds.
    pub of: u64,
    /// Variance of the rate among seeds, divided by that of independent rays; at least 1.
    pub spread: f64,
}

static BASELINES: LazyLock<Vec<Baseline>> = LazyLock::new(|| {
    let read = |text| serde_json::from_str(text).expect("baselines are sound JSON");
    FILES.into_iter().map(read).collect()
});

/// Returns whether an event must never happen, by the definition of the intersector: `exact` has no errors,
/// `watertight` neither leaks nor hits twice.
pub(super) fn is_never(intersector: Intersector, measure: Measure) -> bool {
    intersector.is_exact() || (intersector.is_watertight() && measure != Measure::Wrong)
}

/// Returns the arithmetic that determines an intersector's answers on a device.
fn deciding_arithmetic(by: Intersector, device: Arithmetic) -> Arithmetic {
    if by.is_equal_across_backends() {
        Arithmetic::IEEE
    } else {
        device
    }
}

/// Returns the measured rate of a cell on a device with this arithmetic, or `None` if it was not measured.
pub(super) fn known(
    family: Family,
    by: Intersector,
    measure: Measure,
    device: Arithmetic,
) -> Option<&'static RateEntry> {
    let arithmetic = deciding_arithmetic(by, device);
    let baseline = BASELINES.iter().find(|b| b.arithmetic == arithmetic)?;
    let names = (family.name(), by.name(), measure.name());
    let this = |e: &&RateEntry| (&*e.family, &*e.intersector, &*e.measure) == names;
    baseline.entries.iter().find(this)
}

/// Measures every family on a device, with `rays` rays per family and seed. Seeds are 1 to `seeds`.
///
/// Intersectors that do not depend on the device's arithmetic are measured only on devices with [`Arithmetic::IEEE`].
/// `progress` receives each family when it is finished.
///
/// # Errors
/// The subject failed.
pub fn record(
    subject: &mut dyn Backend,
    seeds: u64,
    rays: u32,
    progress: &mut dyn FnMut(Family),
) -> Result<Baseline> {
    let device = subject.device().clone();
    let arithmetic = device.arithmetic;
    let decides = |by: &Intersector| deciding_arithmetic(*by, arithmetic) == arithmetic;
    let all: Vec<_> = Intersector::ALL.into_iter().filter(decides).collect();
    let mut entries = Vec::new();
    for family in Family::ALL {
        let mut cells: Vec<Vec<StabilityCell>> = vec![Vec::new(); all.len()];
        for seed in 1..=seeds {
            let test = StabilityTest::new(family, &Plan { seed, rays });
            for (&by, cells) in all.iter().zip(&mut cells) {
                cells.push(test.run(subject, by)?);
            }
        }
        entries.extend(cells.iter().flat_map(|c| of_cells(c)));
        progress(family);
    }
    let (driver, backend) = (device.driver.trim(), device.backend);
    Ok(Baseline {
        arithmetic,
        measured_on: format!(
            "{}, {driver}, backend {backend}, {rays} rays per family and seed, seeds 1 to {seeds}",
            device.adapter
        ),
        entries,
    })
}

/// Returns one entry per measure, summed over `cells`, which differ only in their seeds. Omits events that must never
/// happen.
fn of_cells(cells: &[StabilityCell]) -> Vec<RateEntry> {
    let measures = cells.first().map_or(0, |first| first.measured.len());
    let all = (0..measures).map(|i| cells.iter().map(|c| c.measured[i]).collect());
    let recorded =
        all.filter(|all: &Vec<MeasuredRate>| !is_never(cells[0].intersector, all[0].measure));
    recorded
        .map(|all| {
            let count = all.iter().map(|m| m.count).sum();
            let of = all.iter().map(|m| m.of).sum();
            RateEntry {
                family: cells[0].family.name().to_owned(),
                intersector: cells[0].intersector.name().to_owned(),
                measure: all[0].measure.name().to_owned(),
                count,
                of,
                spread: spread(&all, count as f64 / of as f64),
            }
        })
        .collect()
}

/// Returns the variance of the rate among seeds, divided by that of independent rays; at least 1.
fn spread(all: &[MeasuredRate], mean: f64) -> f64 {
    let squares: f64 = all.iter().map(|m| (m.rate() - mean).powi(2)).sum();
    let independent = mean * (1.0 - mean) / all[0].of as f64;
    if independent == 0.0 || all.len() < 2 {
        return 1.0;
    }
    let spread = squares / (all.len() - 1) as f64 / independent;
    (spread.max(1.0) * 100.0).ceil() / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOSE: Arithmetic = Arithmetic {
        rounds_division: false,
        fuses: false,
    };

    /// Returns a cell of rays at edges of closed bodies, with these numbers of wrong answers, leaks and double hits.
    fn edges(
        by: Intersector,
        [wrong, leaks, doubles]: [u64; 3],
        device: Arithmetic,
    ) -> StabilityCell {
        let counts = vec![
            MeasuredRate::new(Measure::Wrong, wrong, 8192),
            MeasuredRate::new(Measure::Leaks, leaks, 4096),
            MeasuredRate::new(Measure::DoubleHits, doubles, 8192),
        ];
        StabilityCell::new(Family::Edges, by, counts, device)
    }

    #[test]
    fn baseline_depends_on_device_arithmetic() {
        let by = Intersector::MollerTrumbore;
        let [of_host, of_gpu] = [[1983, 186, 3828], [2056, 412, 2990]];
        assert!(edges(by, of_host, Arithmetic::IEEE).is_ok());
        assert!(edges(by, of_gpu, LOOSE).is_ok());
        assert!(!edges(by, of_gpu, Arithmetic::IEEE).is_ok());
        assert!(!edges(by, of_host, LOOSE).is_ok());
    }

    #[test]
    fn robust_intersectors_share_one_baseline() {
        let strange = Arithmetic {
            rounds_division: false,
            fuses: true,
        };
        for device in [Arithmetic::IEEE, LOOSE, strange] {
            let of = |by| known(Family::Edges, by, Measure::Wrong, device);
            let by = Intersector::Watertight;
            let everywhere = known(Family::Edges, by, Measure::Wrong, Arithmetic::IEEE);
            assert_eq!(of(Intersector::Watertight), everywhere);
            assert_eq!(of(Intersector::Woop).is_some(), device != strange);
            assert!(edges(Intersector::Exact, [0; 3], device).is_ok());
            assert!(!edges(Intersector::Exact, [1, 0, 0], device).is_ok());
        }
    }

    #[test]
    fn baselines_have_a_rate_of_wrong_hits_for_every_family() {
        for baseline in BASELINES.iter() {
            let of = |by: Intersector| {
                deciding_arithmetic(by, baseline.arithmetic) == baseline.arithmetic
            };
            let all = Intersector::ALL.into_iter().filter(|&by| of(by));
            for (family, by) in all.flat_map(|by| Family::ALL.map(|f| (f, by))) {
                let this = |e: &&RateEntry| e.family == family.name() && e.intersector == by.name();
                let mut found: Vec<_> = baseline.entries.iter().filter(this).collect();
                found.retain(|e| e.measure == Measure::Wrong.name());
                let none = by == Intersector::Exact;
                assert_eq!(found.len(), usize::from(!none), "{family} {by}");
            }
            let measured_on = &baseline.measured_on;
            assert!(measured_on.contains("seed"), "{measured_on}");
        }
    }
}
