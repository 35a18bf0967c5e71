//! Laws that every backend keeps, written once and knowing none by name.
//!
//! A [`Law`] takes a subject and a reference, both by the seam's trait, and a
//! [`Case`] that a seed made; it says `Err` with the first disagreement. The
//! test suite crosses [`LAWS`] with the backends by data, and so does
//! `abvh conform` on the user's own machine.

mod compare;
mod laws;
mod stage;
mod strategies;

pub use laws::{LAWS, Law};
pub use strategies::{Case, Kind, case};

use backend::Backend;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// What a law found: which case, and how subject and reference disagree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("law {law}, seed {seed}, case {case}: {what}")]
pub struct Disagreement {
    /// The law's name.
    pub law: &'static str,
    /// The seed of the whole run.
    pub seed: u64,
    /// The case within the run.
    pub case: u32,
    /// What was seen and what was expected.
    pub what: String,
}

/// Holds `subject` to one law over `cases` cases made from `seed`.
///
/// Case `i` of a seed is the same in every run, on every machine and for every number of cases.
///
/// # Errors
/// The first disagreement.
pub fn hold(
    law: &Law,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
    seed: u64,
    cases: u32,
) -> Result<(), Disagreement> {
    for i in 0..cases {
        let case = nth_case(seed, i);
        (law.check)(&case, subject, reference).map_err(|what| Disagreement {
            law: law.name,
            seed,
            case: i,
            what,
        })?;
    }
    Ok(())
}

/// The `i`-th case of a seed.
#[must_use]
pub fn nth_case(seed: u64, i: u32) -> Case {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    bytes[8..12].copy_from_slice(&i.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    // Kinds take turns, so that few cases already see each of them.
    let kind = Kind::ALL[i as usize % Kind::ALL.len()];
    let tree = case(kind)
        .new_tree(&mut runner)
        .expect("strategies reject nothing");
    tree.current()
}
