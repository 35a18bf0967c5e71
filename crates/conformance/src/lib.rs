//! Properties ("laws") that every backend keeps, written once and knowing none by name.
//!
//! A [`Law`] takes a subject, a reference and a [`Case`] that a seed made; it fails with the first
//! disagreement. The test suite crosses [`LAWS`] with the backends by data, and so does `abvh conform`
//! on the user's own machine.
//! [`leaks`] aims many more rays at closed bodies than a law can. [`stress`] counts wrong answers where
//! arithmetic is hardest, against [`oracle`], which shares no code with any backend.

mod compare;
mod crossings;
mod generate;
mod laws;
pub mod leaks;
pub mod oracle;
mod reference;
pub mod stage;
pub mod stress;

pub use generate::cases::Case;
pub use generate::cases::nth_case;
pub use generate::rays::{RayKind, Target, aimed};
pub use generate::topologies::record;
pub use laws::{LAWS, Law};
pub use reference::Reference;

use anyhow::{Context, anyhow};
use backend::{Backend, Method};
use laws::Check;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a law found: which case, and how subject and reference disagree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("law {law}, seed {seed}, case {case}: {what}; the case is {about}")]
pub struct Disagreement {
    /// The law's name.
    pub law: &'static str,
    /// The seed of the whole run.
    pub seed: u64,
    /// The number of the case.
    pub case: u32,
    /// What was seen and what was expected.
    pub what: String,
    /// What the case is made of.
    pub about: String,
    /// Cases that held before.
    pub held: u32,
}

/// Holds `subject` to one law over these cases of `seed`, by each method that the law asks for; returns how many held.
/// A backend that panics disagrees.
///
/// Case `i` of a seed is the same in every run, on every machine and whatever other cases are tried.
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
        // It has another case loaded.
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
    for method in (law.methods)(&check) {
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
