//! Properties that every backend must have, written once and independent of any particular backend.
//!
//! A [`Property`] takes a subject, a reference and a [`Case`] generated from a seed, and fails with the first
//! disagreement. The test suite runs [`PROPERTIES`] on the backends, and so does `abvh conform` on the user's machine.
//! [`stability`] counts wrong answers where arithmetic is hardest. It compares with [`oracle`], which shares no code
//! with any backend.

mod compare;
mod crossings;
mod generate;
pub mod oracle;
mod properties;
mod reference;
pub mod stability;
pub mod stage;

pub use generate::cases::{Case, nth_case};
pub use generate::rays::{RayKind, Target, aimed};
pub use generate::strategies::seed_bytes;
pub use generate::topologies::uneven_tree;
pub use properties::{PROPERTIES, Property};
pub use reference::Reference;

use anyhow::{Context, anyhow};
use backend::{Inspect, Intersector};
use generate::cases::cases;
use generate::strategies::{runner, value_tree};
use properties::Check;
use proptest::test_runner::{TestCaseError, TestError};
use std::cell::RefCell;
use std::ops::RangeInclusive;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A case in which a property fails, with a description of the failure: the result, and the expected one.
#[derive(Clone, Debug, thiserror::Error)]
#[error("property {property}, seed {seed}, case {case}: {what}; the case shrinks to {minimal}")]
pub struct Disagreement {
    /// Name of the property.
    pub property: &'static str,
    /// Name of the backend.
    pub backend: &'static str,
    /// Seed of the whole run.
    pub seed: u64,
    /// Number of the case.
    pub case: u32,
    /// The observed result and the expected one, in the smallest case.
    pub what: String,
    /// The smallest case that was found to fail.
    pub minimal: Box<Case>,
    /// Number of cases that passed before this one.
    pub held: u32,
}

impl Disagreement {
    /// Returns the options of `abvh conform` that test the property on this case.
    pub fn options(&self) -> String {
        let (property, seed, case) = (self.property, self.seed, self.case);
        format!("--property {property} --seed {seed} --case {case}")
    }
}

/// A range of the cases of a seed.
///
/// Case `i` of a seed is the same in every run and on every machine, and does not depend on the other cases.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cases {
    /// The seed.
    pub seed: u64,
    /// Numbers of the cases.
    pub numbers: RangeInclusive<u32>,
    /// Maximum number of attempts to shrink a failing case. Shrinking also stops after half a minute.
    pub shrinks: u32,
}

impl Cases {
    /// Creates a range of cases with up to 512 attempts to shrink.
    pub fn new(seed: u64, numbers: RangeInclusive<u32>) -> Self {
        Self {
            seed,
            numbers,
            shrinks: 512,
        }
    }
}

/// Tests a property of `subject` on some cases, with every intersector that the property requires.
///
/// Returns the number of cases that passed. Cases without an intersector are skipped and not counted. A panic of the
/// backend counts as a disagreement.
///
/// # Errors
/// The first disagreement, in the smallest case that it shrinks to.
pub fn check_property(
    property: &Property,
    subject: &mut dyn Inspect,
    reference: &mut Reference,
    tested: &Cases,
) -> Result<u32, Disagreement> {
    let backend = subject.device().backend;
    let pair = RefCell::new((subject, reference));
    let mut held = 0;
    for number in tested.numbers.clone() {
        if property.intersectors_of(number).is_empty() {
            continue;
        }
        let mut runner = runner(tested.seed, number, tested.shrinks);
        let case = value_tree(&cases(number), &mut runner);
        let outcome = runner.run_one(case, |case| {
            let (subject, reference) = &mut *pair.borrow_mut();
            reference.unload();
            let found = by_each_intersector(property, &case, *subject, reference);
            found.map_err(|what| TestCaseError::fail(format!("{what:#}")))
        });
        let (what, minimal) = match outcome {
            Ok(_) => {
                held += 1;
                continue;
            }
            Err(TestError::Fail(what, case)) => (what, Box::new(case)),
            Err(TestError::Abort(why)) => unreachable!("no case is rejected: {why}"),
        };
        return Err(Disagreement {
            property: property.name,
            backend,
            seed: tested.seed,
            case: number,
            what: what.to_string(),
            minimal,
            held,
        });
    }
    Ok(held)
}

fn by_each_intersector(
    property: &Property,
    case: &Case,
    subject: &mut dyn Inspect,
    reference: &mut Reference,
) -> anyhow::Result<()> {
    let mut check = Check {
        case,
        subject,
        reference,
        intersector: Intersector::Watertight,
    };
    for intersector in property.intersectors_of(case.number) {
        check.intersector = intersector;
        let held = catch_unwind(AssertUnwindSafe(|| (property.check)(&mut check)));
        let held = held.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(anyhow!("the backend panicked: {}", text.unwrap_or("?")))
        });
        held.with_context(|| intersector.to_string())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cpu_ref::CpuBackend;
    use proptest::strategy::ValueTree;

    /// Number of shrinking steps before the properties are tested. Every third step undoes the step before it.
    const STEPS: usize = 60;

    /// Properties must hold for shrunken cases too. Otherwise shrinking would end at a case that shows no fault.
    #[test]
    fn properties_hold_while_cases_shrink() {
        let backend = || CpuBackend::new(Some(1)).unwrap();
        let (mut subject, mut reference) = (backend(), Reference::new(Box::new(backend())));
        for number in 0..15 {
            let mut case = value_tree(&cases(number), &mut runner(3, number, 0));
            for _ in 0..4 {
                for step in 0..STEPS {
                    let _ = match step % 3 {
                        2 => case.complicate(),
                        _ => case.simplify(),
                    };
                }
                let case = case.current();
                for property in PROPERTIES {
                    reference.unload();
                    let held = by_each_intersector(property, &case, &mut subject, &mut reference);
                    held.unwrap_or_else(|e| panic!("{}: {e:#}; {case}", property.name));
                }
            }
        }
    }
}
