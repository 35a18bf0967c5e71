//! Phases that merge clusters: see build/cluster.wgsl.

use crate::PhaseParams;
use bvh_build::MAX_DEPTH;

/// Number of clusters of a tile.
pub(super) const TILE: u32 = 512;
/// Maximum number of clusters that a tile leaves, except in the last phase.
const CLUSTERS_LEFT: u32 = 128;
/// Number of rounds that merge fixed pairs until a full tile has [`CLUSTERS_LEFT`] clusters.
const PAIRING: u32 = (TILE / CLUSTERS_LEFT).ilog2();
/// Number of rounds that merge fixed pairs until the last tile has only the root.
const LAST_PAIRING: u32 = TILE.ilog2();
/// Maximum number of nearest-neighbour rounds of every phase except the last. Further rounds hardly improve on fixed pairs.
const MAX_ROUNDS: u32 = 8;
/// Number of nearest-neighbour rounds that are reserved for the last phase.
const LAST_ROUNDS: u32 = 16;
// In every second phase, the first tile is half as long. It still has at least `CLUSTERS_LEFT` clusters.
const _: () = assert!(TILE / 2 >= CLUSTERS_LEFT);

/// A phase: the number of its clusters, and its parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phase {
    pub(super) count: u32,
    pub(super) own: PhaseParams,
}

impl Phase {
    /// Returns the number of tiles.
    pub(super) fn tiles(&self) -> u32 {
        (self.count + self.own.tile_offset).div_ceil(TILE)
    }

    /// Returns the number of clusters after the phase.
    pub(super) fn remaining(&self) -> u32 {
        let whole = self.tiles() - 1;
        let last = self.count - (whole * TILE).saturating_sub(self.own.tile_offset);
        whole * self.own.clusters_per_tile + last.min(self.own.clusters_per_tile)
    }
}

/// Returns all phases for `leaves` leaves, at least one.
pub(super) fn of(leaves: u32) -> Vec<Phase> {
    let mut phases = Vec::new();
    let mut next = Phase {
        count: leaves,
        own: PhaseParams {
            clusters_per_tile: 1,
            ..PhaseParams::default()
        },
    };
    while next.count > TILE {
        let phase = Phase {
            count: next.count,
            own: PhaseParams {
                // Alternates between two parts of the buffer. The leaves are not needed after the first phase.
                target_at: if next.own.source_at == 0 { leaves } else { 0 },
                tile_offset: phases.len() as u32 % 2 * (TILE / 2),
                clusters_per_tile: CLUSTERS_LEFT,
                ..next.own
            },
        };
        phases.push(phase);
        next.count = phase.remaining();
        next.own.source_at = phase.own.target_at;
        next.own.first_tile += phase.tiles();
    }
    phases.push(next);
    share_rounds(&mut phases);
    phases
}

/// Distributes the rounds so that the tree's depth never exceeds [`MAX_DEPTH`].
fn share_rounds(phases: &mut [Phase]) {
    let Some((last, others)) = phases.split_last_mut() else {
        return;
    };
    let other_count = others.len() as u32;
    let levels = MAX_DEPTH - LAST_PAIRING - PAIRING * other_count;
    let each = (levels - LAST_ROUNDS.min(levels)).checked_div(other_count);
    let each = each.unwrap_or(0).min(MAX_ROUNDS);
    for phase in others {
        phase.own.search_rounds = each;
    }
    last.own.search_rounds = levels - each * other_count;
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: [u32; 8] = [1, 2, 3, 511, 512, 513, 769, 2049];
    const LARGE: [u32; 4] = [100_000, 1_600_000, 1 << 26, 1 << 30];

    #[test]
    fn phases_reduce_to_one_cluster() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(leaves);
            assert_eq!((phases[0].count, phases[0].own.source_at), (leaves, 0));
            for pair in phases.windows(2) {
                let [before, after] = [pair[0], pair[1]];
                assert!(after.count < before.count, "{leaves}");
                let there = (before.remaining(), before.own.target_at);
                assert_eq!((after.count, after.own.source_at), there, "{leaves}");
                let read = before.own.source_at..before.own.source_at + before.count;
                let written = after.own.source_at..after.own.source_at + after.count;
                assert!(read.end <= written.start || written.end <= read.start);
            }
            assert_eq!(phases.last().map(Phase::remaining), Some(1), "{leaves}");
        }
    }

    #[test]
    fn tree_depth_fits_the_traversal_stack() {
        for leaves in SMALL.into_iter().chain(LARGE) {
            let phases = of(leaves);
            let pairing = LAST_PAIRING + PAIRING * (phases.len() as u32 - 1);
            let search_rounds: u32 = phases.iter().map(|p| p.own.search_rounds).sum();
            assert!(search_rounds + pairing <= MAX_DEPTH, "{leaves}");
            assert!(
                phases.iter().all(|p| p.own.search_rounds > 0),
                "{leaves}: {phases:?}"
            );
        }
    }
}
