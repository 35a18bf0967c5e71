//! The rates that were measured, one an intersector, a family and a thing counted.
//!
//! `baseline.json` is written by `cargo run --release -p stability --example baseline` from the host's answers to many
//! seeds at the usual number of rays. Nothing is in it of what may never happen: see [`known`].

use crate::bounds::Known;
use crate::{Family, Measure};
use backend::Intersector;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A rate over many seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Of what.
    pub family: String,
    /// By what.
    pub intersector: String,
    /// What was counted.
    pub measure: String,
    /// How many were counted, over all seeds.
    pub count: u64,
    /// Of how many rays.
    pub of: u64,
    /// See [`Known::spread`].
    pub spread: f64,
}

static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    serde_json::from_str(include_str!("baseline.json")).expect("the baseline is sound JSON")
});

/// Whether something may never happen, by the intersector's own definition: `exact` errs nowhere,
/// `watertight` neither leaks nor hits twice, and no answer depends on a tree.
#[must_use]
pub fn is_never(intersector: Intersector, measure: Measure) -> bool {
    match (intersector, measure) {
        (Intersector::Exact, _) | (_, Measure::TreeDependent) => true,
        (Intersector::Watertight, Measure::Wrong) => false,
        (Intersector::Watertight, _) => true,
        _ => false,
    }
}

/// What is known of a cell; `None` if nobody measured it.
#[must_use]
pub fn known(family: Family, intersector: Intersector, measure: Measure) -> Option<Known> {
    let names = (family.name(), intersector.name(), measure.name());
    let this = |e: &&Entry| (&*e.family, &*e.intersector, &*e.measure) == names;
    let entry = ENTRIES.iter().find(this)?;
    Some(Known {
        rate: entry.count as f64 / entry.of.max(1) as f64,
        of: entry.of as f64,
        spread: entry.spread,
    })
}
