//! The recursion: finds the split plane of a node and builds its two children.

use crate::bins::{BinCounts, Bins, BlockSize, CHUNK, Grid, Plane};
use crate::cancel::BuildError;
use crate::prim::{Prim, PrimBounds, PrimExtents};
use crate::task::{BuildTask, fits};
use crate::tree::SubtreeSlot;
use crate::{join_if, small};
use rayon::join;
use rayon::prelude::*;
use std::cmp::Reverse;

/// Number of triangles above which a node bins and moves them in parallel.
const PARALLEL_NODE: usize = 2 * CHUNK;
/// [`build`] first divides nodes of more than `triangles / (SUBTREES_A_THREAD * (threads - 1))` triangles, if they exceed
/// [`PARALLEL_NODE`]. Several subtrees per thread balance the load although their sizes differ. A single thread builds the
/// whole tree as one subtree.
const SUBTREES_A_THREAD: usize = 8;
/// Number of triangles above which a node builds its children in parallel and checks for cancellation.
const PARALLEL_CHILDREN: usize = 2048;

/// A node to build: its triangles, a scratch buffer of the same size, and the output for its subtree.
pub(crate) struct BuildNode<'a> {
    pub(crate) prims: &'a mut [Prim],
    pub(crate) scratch: &'a mut [Prim],
    pub(crate) slot: SubtreeSlot<'a>,
    pub(crate) extents: PrimExtents,
    pub(crate) depth: u32,
}

/// A split plane, and the results of binning that partitioning needs.
struct NodeSplit {
    plane: Plane,
    /// Boxes of the left and the right side.
    boxes: [PrimBounds; 2],
    /// Number of triangles on the left.
    left: usize,
    /// Bin counts of each chunk. Empty if the node was binned sequentially.
    chunks: Vec<BinCounts>,
}

/// Builds the tree below `root`. First divides large nodes, level by level, then builds the remaining subtrees in
/// parallel.
///
/// No subtree is built before all large nodes are divided. Otherwise rayon could start a subtree on a thread that
/// waits for parts of a large node. All nodes below the large node would then wait for this subtree.
pub(crate) fn build(root: BuildNode<'_>, task: BuildTask<'_>) -> Result<(), BuildError> {
    let others = rayon::current_num_threads() - 1;
    let share = root.prims.len() / (SUBTREES_A_THREAD * others).max(1);
    let is_large = |node: &BuildNode<'_>| node.prims.len() > share.max(PARALLEL_NODE);
    let (mut level, mut subtrees) = (vec![root], Vec::new());
    while !level.is_empty() {
        if task.cancel.is_cancelled() {
            return Err(BuildError::Cancelled);
        }
        let (large, small): (Vec<_>, Vec<_>) = level.into_iter().partition(is_large);
        subtrees.extend(small);
        let halves = large.into_par_iter().flat_map_iter(|n| divide(n, task));
        level = halves.collect();
    }
    subtrees.sort_by_key(|node| Reverse(node.prims.len()));
    let each = subtrees.into_par_iter().with_max_len(1);
    each.try_for_each(|node| build_subtree(node, task))
}

fn build_subtree(node: BuildNode<'_>, task: BuildTask<'_>) -> Result<(), BuildError> {
    let leaves = node.prims.len();
    if leaves <= small::MOST {
        small::build(node.prims, node.slot, node.depth, task);
        return Ok(());
    }
    if leaves > PARALLEL_CHILDREN && task.cancel.is_cancelled() {
        return Err(BuildError::Cancelled);
    }
    let [first, second] = divide(node, task);
    let (a, b) = join_if(
        leaves > PARALLEL_CHILDREN,
        || build_subtree(first, task),
        || build_subtree(second, task),
    );
    a.and(b)
}

fn divide<'a>(node: BuildNode<'a>, task: BuildTask<'_>) -> [BuildNode<'a>; 2] {
    match find_split(&node, task.block_size) {
        Some(split) => divide_by(node, &split, task.right_first(split.boxes)),
        None => halve(node),
    }
}

/// Returns the best plane. Returns `None` if no plane separates the triangles, or if a child would have too many
/// triangles for the remaining levels.
fn find_split(node: &BuildNode<'_>, block_size: BlockSize) -> Option<NodeSplit> {
    let n = node.prims.len();
    let grid = Grid::new(&node.extents.centers, n);
    let mut chunks = Vec::new();
    let mut bins = Bins::EMPTY;
    if n > PARALLEL_NODE {
        chunks.resize(n.div_ceil(CHUNK), Bins::NO_COUNTS);
        bins.add_parallel(node.prims, &grid, &mut chunks);
    } else {
        bins.add(node.prims, &grid);
    }
    let plane = bins.best_plane(&node.extents.boxes, &grid, block_size)?;
    let left = plane.left_of(&bins.counts);
    fits(left.max(n - left), node.depth + 1).then(|| NodeSplit {
        plane,
        boxes: bins.sides(&plane),
        left,
        chunks,
    })
}

/// Divides a node by a plane. Returns both sides, the right side first if `right_first` is set.
fn divide_by<'a>(node: BuildNode<'a>, split: &NodeSplit, right_first: bool) -> [BuildNode<'a>; 2] {
    let first = if right_first {
        node.prims.len() - split.left
    } else {
        split.left
    };
    let (a, b) = node.scratch.split_at_mut(first);
    let (left, right) = if right_first { (b, a) } else { (a, b) };
    let centers = if split.chunks.is_empty() {
        partition(node.prims, &split.plane, left, right)
    } else {
        partition_parallel(node.prims, &split.plane, &split.chunks, left, right)
    };
    let order = if right_first { [1, 0] } else { [0, 1] };
    let sides = order.map(|side| PrimExtents {
        boxes: split.boxes[side],
        centers: centers[side],
    });
    let moved = BuildNode {
        prims: node.scratch,
        scratch: node.prims,
        ..node
    };
    cut(moved, first, sides)
}

/// Returns the extents of `prims`, computed by chunks in parallel.
fn extents(prims: &[Prim]) -> PrimExtents {
    if prims.len() <= CHUNK {
        return PrimExtents::of(prims);
    }
    let (a, b) = prims.split_at(prims.len().div_ceil(CHUNK) / 2 * CHUNK);
    let (a, b) = join(|| extents(a), || extents(b));
    a.union(b)
}

/// Divides a node into halves in the current order. Used for nodes without a usable plane: see [`find_split`].
fn halve(node: BuildNode<'_>) -> [BuildNode<'_>; 2] {
    let left = node.prims.len() / 2;
    let sides = [extents(&node.prims[..left]), extents(&node.prims[left..])];
    cut(node, left, sides)
}

/// Cuts a node after its first `left` triangles.
fn cut(node: BuildNode<'_>, left: usize, [a, b]: [PrimExtents; 2]) -> [BuildNode<'_>; 2] {
    let (prims_a, prims_b) = node.prims.split_at_mut(left);
    let (scratch_a, scratch_b) = node.scratch.split_at_mut(left);
    let [slot_a, slot_b] = node.slot.split(left);
    let sides = [
        (prims_a, scratch_a, slot_a, a),
        (prims_b, scratch_b, slot_b, b),
    ];
    sides.map(|(prims, scratch, slot, extents)| BuildNode {
        prims,
        scratch,
        slot,
        extents,
        depth: node.depth + 1,
    })
}

/// Copies the triangles left of `plane` into `left` and the others into `right`. The lengths of both must match.
/// Returns the bounds of the centres of each side.
#[inline(never)]
pub(crate) fn partition(
    from: &[Prim],
    plane: &Plane,
    left: &mut [Prim],
    right: &mut [Prim],
) -> [PrimBounds; 2] {
    let mut centers = [PrimBounds::EMPTY; 2];
    let mut next = [0; 2];
    for prim in from {
        let side = usize::from(!plane.is_left(prim));
        let to = if side == 0 { &mut *left } else { &mut *right };
        to[next[side]] = *prim;
        next[side] += 1;
    }
    for (centers, side) in centers.iter_mut().zip([left, right]) {
        for prim in side {
            centers.grow(&PrimBounds::of_point(prim.center()));
        }
    }
    centers
}

/// Runs [`partition`] by chunks in parallel. `counts` holds the counts of each chunk's bins.
pub(crate) fn partition_parallel(
    from: &[Prim],
    plane: &Plane,
    counts: &[BinCounts],
    left: &mut [Prim],
    right: &mut [Prim],
) -> [PrimBounds; 2] {
    if counts.len() == 1 {
        return partition(from, plane, left, right);
    }
    let (counts_a, counts_b) = counts.split_at(counts.len() / 2);
    let (first, second) = from.split_at(counts_a.len() * CHUNK);
    let lefts: usize = counts_a.iter().map(|c| plane.left_of(c)).sum();
    let (left_a, left_b) = left.split_at_mut(lefts);
    let (right_a, right_b) = right.split_at_mut(first.len() - lefts);
    let (a, b) = join(
        || partition_parallel(first, plane, counts_a, left_a, right_a),
        || partition_parallel(second, plane, counts_b, left_b, right_b),
    );
    [a[0].union(b[0]), a[1].union(b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::tests::sized;

    #[test]
    fn parallel_partition_is_stable() {
        let n = 3 * CHUNK + 17;
        let at = |i: usize| std::array::from_fn(|k| (i * (7919 + 31 * k) % 1009) as f32);
        let prim = |i: usize| Prim::new(&sized(at(i), [0.0; 3]), i as u32);
        let prims: Vec<_> = (0..n).map(prim).collect();
        let extents = PrimExtents::of(&prims);
        let grid = Grid::new(&extents.centers, n);
        let mut counts = vec![Bins::NO_COUNTS; n.div_ceil(CHUNK)];
        let mut bins = Bins::EMPTY;
        bins.add_parallel(&prims, &grid, &mut counts);
        let plane = bins
            .best_plane(&extents.boxes, &grid, BlockSize::One)
            .unwrap();
        let left = plane.left_of(&bins.counts);
        assert!(left > 0 && left < n);
        let mut moved = vec![Prim::default(); n];
        let (l, r) = moved.split_at_mut(left);
        let centers = partition_parallel(&prims, &plane, &counts, l, r);
        let (expected_l, expected_r): (Vec<_>, _) = prims.iter().partition(|p| plane.is_left(p));
        let ids = |prims: &[Prim]| prims.iter().map(Prim::triangle).collect::<Vec<_>>();
        assert_eq!([ids(l), ids(r)], [ids(&expected_l), ids(&expected_r)]);
        for (found, side) in centers.iter().zip([l, r]) {
            assert_eq!(found.aabb(), PrimExtents::of(side).centers.aabb());
        }
    }
}
