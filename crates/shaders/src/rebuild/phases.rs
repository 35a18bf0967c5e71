//! How clusters become fewer, phase by phase: see build/cluster.wgsl.

use bvh_build::MAX_DEPTH;

/// Clusters of a tile.
pub(super) const TILE: u32 = 512;
/// Clusters that a tile of any phase but the last leaves.
const GOAL: u32 = 128;
/// Rounds of pairs that take a whole tile to its goal, and a last tile to the root.
const PAIRING: u32 = (TILE / GOAL).ilog2();
const LAST_PAIRING: u32 = TILE.ilog2();
/// More rounds than these find next to nothing to merge that pairing would not.
const MOST_ROUNDS: u32 = 8;
/// Rounds of the last phase that seek neighbours come before those of others.
const LAST_ROUNDS: u32 = 16;
// Even the short first tile of every other phase leaves its goal.
const _: () = assert!(TILE / 2 >= GOAL);

/// A phase: one dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Phase {
    /// Clusters before it.
    pub(super) count: u32,
    /// Where they lie.
    pub(super) first: u32,
    /// Where those after it go.
    pub(super) destination: u32,
    /// By how many clusters all tiles but the first begin early.
    pub(super) shift: u32,
    /// Clusters that a tile leaves.
    pub(super) goal: u32,
    /// Rounds that seek neighbours.
    pub(super) rounds: u32,
}

impl Phase {
    pub(super) fn tiles(&self) -> u32 {
        (self.count + self.shift).div_ceil(TILE)
    }

    /// Clusters after it.
    pub(super) fn left(&self) -> u32 {
        let whole = self.tiles() - 1;
        let last = self.count - (whole * TILE).saturating_sub(self.shift);
        whole * self.goal + last.min(self.goal)
    }
}

/// All phases for so many leaves, at least one.
pub(super) fn of(leaves: u32) -> Vec<Phase> {
    let mut phases = Vec::new();
    let (mut count, mut first) = (leaves, 0);
    while count > TILE {
        let phase = Phase {
            count,
            first,
            // There and back: the leaves' own room is free after the first phase.
            destination: if first == 0 { leaves } else { 0 },
            shift: phases.len() as u32 % 2 * (TILE / 2),
            goal: GOAL,
            rounds: 0,
        };
        phases.push(phase);
        (count, first) = (phase.left(), phase.destination);
    }
    phases.push(Phase {
        count,
        first,
        destination: 0,
        shift: 0,
        goal: 1,
        rounds: 0,
    });
    share_rounds(&mut phases);
    phases
}

/// Shares out the rounds for which the tree has levels, so that it stays within [`MAX_DEPTH`] whatever happens.
fn share_rounds(phases: &mut [Phase]) {
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
    fn every_phase_takes_up_what_the_one_before_left_elsewhere_and_one_cluster_remains() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(leaves);
            assert_eq!((phases[0].count, phases[0].first), (leaves, 0));
            for pair in phases.windows(2) {
                let [before, after] = [pair[0], pair[1]];
                assert!(after.count < before.count, "{leaves}");
                let there = (before.left(), before.destination);
                assert_eq!((after.count, after.first), there, "{leaves}");
                let read = before.first..before.first + before.count;
                let written = after.first..after.first + after.count;
                assert!(read.end <= written.start || written.end <= read.start);
            }
            assert_eq!(phases.last().map(Phase::left), Some(1), "{leaves}");
        }
    }

    #[test]
    fn no_tree_is_deeper_than_a_traversal_stack() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(leaves);
            let pairing = LAST_PAIRING + PAIRING * (phases.len() as u32 - 1);
            let rounds: u32 = phases.iter().map(|p| p.rounds).sum();
            assert!(rounds + pairing <= MAX_DEPTH, "{leaves}");
            assert!(phases.iter().all(|p| p.rounds > 0), "{leaves}: {phases:?}");
        }
    }
}
