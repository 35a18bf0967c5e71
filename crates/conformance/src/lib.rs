//! Laws that every backend keeps, written once and knowing none by name.
//!
//! A [`Law`] takes a subject and a reference, both by the seam's trait, and a
//! [`Case`] that a seed made; it says `Err` with the first disagreement. The
//! test suite crosses [`LAWS`] (or [`OWN_TREE_LAWS`], for backends whose drivers decide what a ray hits) with the backends by data, and so does
//! `abvh conform` on the user's own machine. [`leaks`] asks closed bodies many
//! more questions than a law can. [`stress`] counts wrong answers where arithmetic is hardest, against [`oracle`], which shares no code
//! with any backend.

mod case;
mod compare;
mod laws;
mod layout_adapter;
pub mod leaks;
pub mod oracle;
mod places;
mod rays;
mod regressions;
mod rounding;
mod scenes;
mod shapes;
mod stage;
pub mod stress;
mod topologies;

pub use case::Case;
pub use laws::{LAWS, Law, OWN_TREE_LAWS, laws_of};
pub use rays::Family;
pub use regressions::{REGRESSIONS, Regression};
pub use scenes::{SceneKind, case};

use backend::{Backend, Layout};
use layout_adapter::{LayoutAdapter, lays};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Which scene and rays a law is tried on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trial {
    /// One of [`REGRESSIONS`], by name.
    Regression(&'static str),
    /// A case of the seed, by number.
    Case(u32),
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Regression(name) => f.pad(name),
            Self::Case(i) => i.fmt(f),
        }
    }
}

/// What a law found: which case, and how subject and reference disagree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("law {law}, seed {seed}, case {trial}: {what}; the case is {about}")]
pub struct Disagreement {
    /// The law's name.
    pub law: &'static str,
    /// The seed of the whole run.
    pub seed: u64,
    /// The case within the run.
    pub trial: Trial,
    /// What was seen and what was expected.
    pub what: String,
    /// What the case is made of.
    pub about: String,
    /// Trials that held before.
    pub held: u32,
}

/// All regressions, then `cases` cases of the seed.
pub fn trials(cases: u32) -> impl Iterator<Item = Trial> {
    let regressions = REGRESSIONS.iter().map(|r| Trial::Regression(r.name));
    regressions.chain((0..cases).map(Trial::Case))
}

/// Holds `subject` to one law over regressions and `cases` cases made from `seed`; returns how many trials held.
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
) -> Result<u32, Disagreement> {
    let mut held = 0;
    for trial in trials(cases) {
        hold_one(law, subject, reference, seed, trial)
            .map_err(|found| Disagreement { held, ..found })?;
        held += 1;
    }
    Ok(held)
}

/// Holds `subject` to one law over one case, with each layout that it has. A backend that panics disagrees.
///
/// # Errors
/// The disagreement.
///
/// # Panics
/// If there is no regression of that name.
pub fn hold_one(
    law: &Law,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
    seed: u64,
    trial: Trial,
) -> Result<(), Disagreement> {
    let case = match trial {
        Trial::Case(i) => nth_case(seed, i),
        Trial::Regression(name) => {
            let found = REGRESSIONS.iter().find(|r| r.name == name);
            found.expect("regressions go by their names").case()
        }
    };
    let found = check(law, &case, subject, reference);
    found.map_err(|what| Disagreement {
        law: law.name,
        seed,
        trial,
        what,
        about: case.to_string(),
        held: 0,
    })
}

/// Tries the law on the usual layout, and on each other that the subject has and the law does not choose itself.
fn check(
    law: &Law,
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    calmly(|| (law.check)(case, subject, reference))?;
    let others = Layout::ALL.into_iter().filter(|&l| l != Layout::Bvh2);
    for layout in others.filter(|_| !law.chooses_layouts) {
        let mut attempt = || {
            if !lays(subject, layout) {
                return Ok(());
            }
            let mut layout_adapter = LayoutAdapter {
                inner: &mut *subject,
                layout,
            };
            (law.check)(case, &mut layout_adapter, reference)
        };
        calmly(&mut attempt).map_err(|what| format!("layout {layout}: {what}"))?;
    }
    Ok(())
}

/// A panic is a disagreement.
fn calmly(attempt: impl FnOnce() -> Result<(), String>) -> Result<(), String> {
    catch_unwind(AssertUnwindSafe(attempt)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!("the backend panicked: {}", text.unwrap_or("?")))
    })
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
    let kind = SceneKind::ALL[i as usize % SceneKind::ALL.len()];
    let tree = case(kind)
        .new_tree(&mut runner)
        .expect("strategies reject nothing");
    tree.current()
}
