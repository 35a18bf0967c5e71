//! Properties that every backend must have, written once and independent of any particular backend.
//!
//! A [`Law`] is one property. It takes a subject, a reference and a [`Case`] generated from a seed, and fails with the
//! first disagreement. The test suite runs [`LAWS`] on every backend, and so does `abvh conform` on the user's machine.
//! Backends whose drivers determine hits are tested with [`OWN_TREE_LAWS`] instead. [`leaks`] traces many more rays at
//! closed bodies than a property can. [`stress`] counts wrong answers where arithmetic is hardest, against [`oracle`],
//! which shares no code with any backend.

mod compare;
mod crossings;
mod generate;
mod laws;
pub mod leaks;
pub mod oracle;
mod reference;
mod rounding;
pub mod stage;
pub mod stress;

pub use generate::cases::Case;
pub use generate::cases::nth_case;
pub use generate::rays::{RayKind, Target, aimed};
pub use generate::topologies::record;
pub use laws::{LAWS, Law, OWN_TREE_LAWS, laws_of};
pub use reference::Reference;

use anyhow::{Context, anyhow};
use backend::{Backend, Method};
use laws::Check;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A case in which a property fails, with a description of the disagreement between subject and reference.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("law {law}, seed {seed}, case {case}: {what}; the case is {about}")]
pub struct Disagreement {
    /// Name of the property.
    pub law: &'static str,
    /// Seed of the whole run.
    pub seed: u64,
    /// Number of the case.
    pub case: u32,
    /// The observed result and the expected one.
    pub what: String,
    /// Description of the case.
    pub about: String,
    /// Number of cases that passed before.
    pub held: u32,
}

/// Tests a property of `subject` on these cases of `seed`, with every method that the property requires.
///
/// Returns the number of cases that passed. A panic of the backend counts as a disagreement. Case `i` of a seed is the
/// same in every run and on every machine, whichever other cases are tested.
///
/// # Errors
/// The first disagreement.
pub fn hold(
    law: &Law,
    subject: &mut dyn Backend,
    reference: &mut Reference,
    seed: u64,
    cases: impl IntoIterator<Item = u32>,
) -> Result<u32, Disagreement> {
    let mut held = 0;
    for number in cases {
        let case = nth_case(seed, number);
        // Resets the reference, which has another case loaded.
        reference.backend();
        let found = by_each_method(law, &case, subject, reference);
        found.map_err(|what| Disagreement {
            law: law.name,
            seed,
            case: number,
            what: format!("{what:#}"),
            about: case.to_string(),
            held,
        })?;
        held += 1;
    }
    Ok(held)
}

fn by_each_method(
    law: &Law,
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut Reference,
) -> anyhow::Result<()> {
    let mut check = Check {
        case,
        subject,
        reference,
        method: Method::default(),
    };
    for method in (law.methods)(&check)? {
        check.method = method;
        let held = catch_unwind(AssertUnwindSafe(|| (law.check)(&mut check)));
        let held = held.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(anyhow!("the backend panicked: {}", text.unwrap_or("?")))
        });
        held.with_context(|| format!("{method:?}"))?;
    }
    Ok(())
}
