//! Phases that merge clusters: see build/cluster.wgsl.

use crate::Params;
use bvh_build::MAX_DEPTH;

/// Number of clusters of a tile.
pub(super) const TILE: u32 = 512;
/// Number of clusters that a tile leaves, except in the last phase.
const GOAL: u32 = 128;
/// Number of rounds of pairing that reduce a full tile to its goal, and the last tile to the root.
const PAIRING: u32 = (TILE / GOAL).ilog2();
const LAST_PAIRING: u32 = TILE.ilog2();
/// Maximum number of rounds by nearest neighbours. Further rounds find hardly any merges that pairing would not make.
const MOST_ROUNDS: u32 = 8;
/// Number of such rounds that the last phase receives before all others.
const LAST_ROUNDS: u32 = 16;
// Even the short first tile of every other phase has enough clusters to leave its goal.
const _: () = assert!(TILE / 2 >= GOAL);

/// Returns the number of tiles of a phase.
pub(super) fn tiles(phase: &Params) -> u32 {
    (phase.count + phase.shift).div_ceil(TILE)
}

/// Returns the number of clusters after a phase.
pub(super) fn left(phase: &Params) -> u32 {
    let whole = tiles(phase) - 1;
    let last = phase.count - (whole * TILE).saturating_sub(phase.shift);
    whole * phase.goal + last.min(phase.goal)
}

/// Returns the parameters of all phases for `leaves` leaves, at least one. `shared` holds the common values.
pub(super) fn of(shared: Params, leaves: u32) -> Vec<Params> {
    let mut phases = Vec::new();
    let mut next = Params {
        count: leaves,
        first: 0,
        first_group: 0,
        ..shared
    };
    while next.count > TILE {
        let phase = Params {
            // Alternates between two areas: that of the leaves is free after the first phase.
            destination: if next.first == 0 { leaves } else { 0 },
            shift: phases.len() as u32 % 2 * (TILE / 2),
            goal: GOAL,
            ..next
        };
        phases.push(phase);
        (next.count, next.first) = (left(&phase), phase.destination);
        next.first_group += tiles(&phase);
    }
    (next.destination, next.shift, next.goal) = (0, 0, 1);
    phases.push(next);
    share_rounds(&mut phases);
    phases
}

/// Distributes the rounds so that the tree's depth never exceeds [`MAX_DEPTH`].
fn share_rounds(phases: &mut [Params]) {
    let Some((last, others)) = phases.split_last_mut() else {
        return;
    };
    let many = others.len() as u32;
    let levels = MAX_DEPTH - LAST_PAIRING - PAIRING * many;
    let each = (levels - LAST_ROUNDS.min(levels)).checked_div(many);
    let each = each.unwrap_or(0).min(MOST_ROUNDS);
    for phase in others {
        phase.rounds = each;
    }
    last.rounds = levels - each * many;
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: [u32; 8] = [1, 2, 3, 511, 512, 513, 769, 2049];
    const LARGE: [u32; 4] = [100_000, 1_600_000, 1 << 26, 1 << 30];

    #[test]
    fn phases_reduce_to_one_cluster() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(Params::default(), leaves);
            assert_eq!((phases[0].count, phases[0].first), (leaves, 0));
            for pair in phases.windows(2) {
                let [before, after] = [pair[0], pair[1]];
                assert!(after.count < before.count, "{leaves}");
                let there = (left(&before), before.destination);
                assert_eq!((after.count, after.first), there, "{leaves}");
                let read = before.first..before.first + before.count;
                let written = after.first..after.first + after.count;
                assert!(read.end <= written.start || written.end <= read.start);
            }
            assert_eq!(phases.last().map(left), Some(1), "{leaves}");
        }
    }

    #[test]
    fn tree_depth_fits_the_traversal_stack() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(Params::default(), leaves);
            let pairing = LAST_PAIRING + PAIRING * (phases.len() as u32 - 1);
            let rounds: u32 = phases.iter().map(|p| p.rounds).sum();
            assert!(rounds + pairing <= MAX_DEPTH, "{leaves}");
            assert!(phases.iter().all(|p| p.rounds > 0), "{leaves}: {phases:?}");
        }
    }
}
