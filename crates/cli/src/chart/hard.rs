//! Rays at closed bodies and in scenes of mixed range, by every method.

use crate::choose::{self, Ask};
use crate::open;
use crate::stop::Stop;
use backend::{Intersector, Method};
use conformance::leaks::{self, Aim, LeakPlan, LeakRow, OFFSETS};
use conformance::stress::{Family, Plan, StressTest};
use output::plot::{FamilyCounts, Leaks};

const SEED: u64 = 1;
const LEAST: usize = 6_000;
/// Scenes in which sizes or distances differ by many orders of magnitude.
const MIXED_RANGE: [Family; 3] = [Family::Outlier, Family::Exploding, Family::ExtremeKeys];

/// Scenes of mixed range with their exact answers.
pub(super) fn families(rays: usize) -> Vec<StressTest> {
    let rays = (rays / 32).clamp(1 << 11, 1 << 16) as u32;
    let plan = Plan { seed: SEED, rays };
    MIXED_RANGE.map(|f| StressTest::new(f, &plan)).into()
}

/// How often a way's backend and intersector are wrong in scenes of mixed range, and what closed bodies lose of a
/// quarter of `rays` at each offset, of which a third are aimed from inside at edges and vertices.
pub(super) fn ask(
    ask: &Ask<'_>,
    tests: &[StressTest],
    rays: usize,
) -> Result<(Vec<FamilyCounts>, Vec<Leaks>), Stop> {
    let method = Method::from(choose::intersector(ask.method.intersector).0);
    let mut backend = open::bare(ask.backend, None, host::cores())?;
    let mut mixed_range = Vec::new();
    for test in tests {
        if let Some(cell) = test.ask(backend.as_mut(), method.intersector)? {
            mixed_range.push(FamilyCounts {
                family: cell.family.name().to_owned(),
                rays: cell.wrong().of,
                wrong: cell.wrong().count,
            });
        }
    }
    let plan = LeakPlan {
        seed: SEED,
        rays: ((rays / 4).max(LEAST) * OFFSETS.len()) as u64,
        offsets: OFFSETS.to_vec(),
        method,
    };
    let found = leaks::run(backend.as_mut(), &plan, &mut |_| {})?;
    let mut leaks: Vec<Leaks> = OFFSETS.map(|o| sum(&found.rows, o)).to_vec();
    if method.intersector == Intersector::Exact {
        // Its triangles are closed, so that two may share a hit: no fault, and not counted as one.
        for at in &mut leaks {
            (at.counted, at.double_hits) = (0, 0);
        }
    }
    Ok((mixed_range, leaks))
}

/// All bodies at one offset.
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
    fn only_rays_aimed_from_inside_at_that_offset_count() {
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
