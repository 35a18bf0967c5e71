//! Rays at closed meshes and in scenes of mixed range, for every method.

use crate::stop::Stop;
use backend::{Backend, Intersector};
use conformance::leaks::{self, Aim, LeakPlan, LeakRow, OFFSETS};
use conformance::stress::{Family, Plan, StressTest};
use output::plot::{FamilyCounts, Leaks};

const SEED: u64 = 1;
/// Minimum and maximum number of rays at closed meshes per offset. Rates there differ so much that more rays add
/// nothing.
const LEAKS: [usize; 2] = [6_000, 48_000];
/// Minimum and maximum number of rays of each family of mixed range.
const MIXED: [usize; 2] = [1 << 11, 1 << 12];
/// Scenes in which sizes or distances differ by many orders of magnitude.
const MIXED_RANGE: [Family; 3] = [Family::Outlier, Family::Exploding, Family::ExtremeKeys];

/// Returns scenes of mixed range with their exact answers.
pub(super) fn families(rays: usize) -> Vec<StressTest> {
    let rays = (rays / 32).clamp(MIXED[0], MIXED[1]) as u32;
    let plan = Plan { seed: SEED, rays };
    MIXED_RANGE.map(|f| StressTest::new(f, &plan)).into()
}

/// Counts of one method.
pub(super) struct HardCounts {
    pub(super) mixed_range: Vec<FamilyCounts>,
    pub(super) leaks: Vec<Leaks>,
}

/// Counts wrong answers in scenes of mixed range, and leaks and double hits of closed meshes. Each offset gets a
/// quarter of `rays`, within [`LEAKS`]. A third of its rays are aimed from inside at edges and vertices.
pub(super) fn count(
    backend: &mut dyn Backend,
    intersector: Intersector,
    tests: &[StressTest],
    rays: usize,
) -> Result<HardCounts, Stop> {
    let mut mixed_range = Vec::new();
    for test in tests {
        let cell = test.ask(backend, intersector)?;
        mixed_range.push(FamilyCounts {
            family: cell.family.name().to_owned(),
            rays: cell.wrong().of,
            wrong: cell.wrong().count,
        });
    }
    let plan = LeakPlan {
        seed: SEED,
        rays: ((rays / 4).clamp(LEAKS[0], LEAKS[1]) * OFFSETS.len()) as u64,
        offsets: OFFSETS.to_vec(),
        intersector,
    };
    let found = leaks::run(backend, &plan, &mut |_| {})?;
    let mut leaks: Vec<Leaks> = OFFSETS.map(|o| sum(&found.rows, o)).to_vec();
    if intersector == Intersector::Exact {
        // Its triangles include their edges, so two may share a hit. That is correct and not counted.
        for at in &mut leaks {
            (at.counted, at.double_hits) = (0, 0);
        }
    }
    Ok(HardCounts { mixed_range, leaks })
}

/// Sums the rows of all meshes at one offset.
fn sum(rows: &[LeakRow], offset: f32) -> Leaks {
    let is_here = |r: &&LeakRow| r.offset.to_bits() == offset.to_bits();
    let is_aimed = |r: &&LeakRow| r.inside && r.aim != Aim::Random;
    let sum = |count: fn(&LeakRow) -> u64| {
        let here = rows.iter().filter(is_here).filter(is_aimed);
        here.map(count).sum()
    };
    Leaks {
        offset: f64::from(offset),
        rays: sum(|r| r.rays),
        leaks: sum(|r| r.leaks),
        counted: sum(|r| r.counted),
        double_hits: sum(|r| r.doubled),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_only_aimed_inside_rays() {
        let row = |offset, aim, inside| LeakRow {
            body: "box",
            offset,
            aim,
            inside,
            rays: 100,
            leaks: 3,
            counted: 10,
            miscounts: 5,
            doubled: 2,
        };
        let rows = [
            row(10.0, Aim::Edge, true),
            row(10.0, Aim::Vertex, true),
            row(10.0, Aim::Random, true),
            row(10.0, Aim::Edge, false),
            row(0.0, Aim::Edge, true),
        ];
        let expected = Leaks {
            offset: 10.0,
            rays: 200,
            leaks: 6,
            counted: 20,
            double_hits: 4,
        };
        assert_eq!(sum(&rows, 10.0), expected);
    }
}
