//! Properties that every backend must have, written once and independent of any particular backend.
//!
//! A [`Property`] takes a subject, a reference and a [`Case`] generated from a seed, and fails with the first
//! disagreement. The test suite runs [`PROPERTIES`] on every backend, and so does `abvh conform` on the user's machine.
//! Backends whose drivers determine hits are tested with [`OWN_TREE_PROPERTIES`] instead. [`leaks`] traces many more
//! rays at closed bodies than a property can. [`stress`] counts wrong answers where arithmetic is hardest, against
//! [`oracle`], which shares no code with any backend.

mod compare;
mod crossings;
mod generate;
pub mod leaks;
pub mod oracle;
mod properties;
mod reference;
mod rounding;
pub mod stage;
pub mod stress;

pub use generate::cases::Case;
pub use generate::cases::nth_case;
pub use generate::rays::{RayKind, Target, aimed};
pub use generate::topologies::record;
pub use properties::{OWN_TREE_PROPERTIES, PROPERTIES, Property, properties_of};
pub use reference::Reference;

use anyhow::{Context, anyhow};
use backend::{Backend, Method};
use properties::Check;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A case in which a property fails, with a description of the disagreement between subject and reference.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("property {property}, seed {seed}, case {case}: {what}; the case is {about}")]
pub struct Disagreement {
    /// Name of the property.
    pub property: &'static str,
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
    property: &Property,
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
        let found = by_each_method(property, &case, subject, reference);
        found.map_err(|what| Disagreement {
            property: property.name,
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
    property: &Property,
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
    for method in (property.methods)(&check)? {
        check.method = method;
        let held = catch_unwind(AssertUnwindSafe(|| (property.check)(&mut check)));
        let held = held.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(anyhow!("the backend panicked: {}", text.unwrap_or("?")))
        });
        held.with_context(|| format!("{method:?}"))?;
    }
    Ok(())
}
