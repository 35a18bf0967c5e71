//! Counts wrong answers in scenes of mixed range. A *family* is one kind of numerically hard scenes and rays.

use crate::error::CliError;
use backend::{Backend, Intersector};
use conformance::stability::{Family, Plan, StabilityTest};
use output::plot::FamilyCounts;

/// Minimum and maximum number of rays of each family.
const RAYS: [usize; 2] = [1 << 11, 1 << 12];
/// Scenes in which sizes or distances differ by many orders of magnitude.
const MIXED_RANGE: [Family; 3] = [Family::Outlier, Family::Exploding, Family::ExtremeKeys];

/// Returns the tests of scenes of mixed range, with exact answers.
pub(super) fn tests(rays: usize) -> Vec<StabilityTest> {
    let rays = (rays / 32).clamp(RAYS[0], RAYS[1]) as u32;
    let plan = Plan { seed: 1, rays };
    MIXED_RANGE.map(|f| StabilityTest::new(f, &plan)).into()
}

/// Counts wrong answers of one method in scenes of mixed range.
pub(super) fn count(
    backend: &mut dyn Backend,
    intersector: Intersector,
    tests: &[StabilityTest],
) -> Result<Vec<FamilyCounts>, CliError> {
    let mut counts = Vec::new();
    for test in tests {
        let cell = test.run(backend, intersector)?;
        counts.push(FamilyCounts {
            family: cell.family.name().to_owned(),
            rays: cell.wrong().of,
            wrong: cell.wrong().count,
        });
    }
    Ok(counts)
}
