//! The recursion: one node, its plane, its two children.

use crate::bins::{Bins, BlockSize, CHUNK, Counts, Grid, Plane};
use crate::occluder_first::reach;
use crate::prim::{Bounds, Extents, Prim};
use crate::tree::SubtreeSlot;
use crate::{BuildError, Cancel, MAX_DEPTH, join_if, small};
use geom::Point;
use rayon::join;
use rayon::prelude::*;
use std::cmp::Reverse;

/// Nodes of more triangles than this bin and move them in parallel.
const PARALLEL_NODE: usize = 2 * CHUNK;
/// So many subtrees for each thread but the first, or more, are built side by side, so that their different sizes even out.
const SUBTREES_A_THREAD: usize = 8;
/// Nodes of more triangles than this build their children in parallel and ask whether to go on.
const PARALLEL_CHILDREN: usize = 2048;

/// A node to build: its triangles, room of the same size to move them to, and where its part of the tree goes.
pub(crate) struct Node<'a> {
    pub(crate) prims: &'a mut [Prim],
    pub(crate) room: &'a mut [Prim],
    pub(crate) slot: SubtreeSlot<'a>,
    pub(crate) extents: Extents,
    pub(crate) depth: u32,
}

/// A plane with what binning found out about its sides.
struct Split {
    plane: Plane,
    boxes: [Bounds; 2],
    left: usize,
    chunks: Vec<Counts>,
}

/// What all nodes of a build have in common.
#[derive(Clone, Copy)]
pub(crate) struct BuildTask<'a> {
    pub(crate) cancel: &'a Cancel,
    /// Where rays go for which the order of children counts.
    pub(crate) toward: Option<Point>,
    pub(crate) block_size: BlockSize,
}

impl BuildTask<'_> {
    /// Whether what lies right of a plane comes first.
    fn right_first(self, sides: [Bounds; 2]) -> bool {
        self.toward.is_some_and(|point| {
            let [left, right] = sides.map(|b| reach(&b.aabb(), point));
            right < left
        })
    }
}

/// Builds the tree below `root`: divides what is large, wave by wave, then builds what is left side by side.
///
/// Were subtrees built while large nodes are still to be divided, a thread that waits for the rest of such a node would
/// meanwhile take up a subtree, and all that the node leads to would wait for that.
pub(crate) fn build(root: Node<'_>, task: BuildTask<'_>) -> Result<(), BuildError> {
    let others = rayon::current_num_threads() - 1;
    let share = root.prims.len() / (SUBTREES_A_THREAD * others).max(1);
    let is_large = |node: &Node<'_>| node.prims.len() > share.max(PARALLEL_NODE);
    let (mut wave, mut subtrees) = (vec![root], Vec::new());
    while !wave.is_empty() {
        if task.cancel.is_cancelled() {
            return Err(BuildError::Cancelled);
        }
        let (large, small): (Vec<_>, Vec<_>) = wave.into_iter().partition(is_large);
        subtrees.extend(small);
        let halves = large.into_par_iter().flat_map_iter(|n| divide(n, task));
        wave = halves.collect();
    }
    subtrees.sort_by_key(|node| Reverse(node.prims.len()));
    let each = subtrees.into_par_iter().with_max_len(1);
    each.try_for_each(|node| build_subtree(node, task))
}

fn build_subtree(node: Node<'_>, task: BuildTask<'_>) -> Result<(), BuildError> {
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

fn divide<'a>(node: Node<'a>, task: BuildTask<'_>) -> [Node<'a>; 2] {
    match find_split(&node, task.block_size) {
        Some(split) => divide_by(node, &split, task.right_first(split.boxes)),
        None => halve(node),
    }
}

/// The best plane, unless it would make a child too large for the levels that are left.
fn find_split(node: &Node<'_>, block_size: BlockSize) -> Option<Split> {
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
    fits(left.max(n - left), node.depth + 1).then(|| Split {
        plane,
        boxes: bins.sides(&plane),
        left,
        chunks,
    })
}

/// Whether a node of so many leaves can stay within [`MAX_DEPTH`] by halving.
pub(crate) fn fits(leaves: usize, depth: u32) -> bool {
    depth + leaves.next_power_of_two().trailing_zeros() <= MAX_DEPTH
}

/// Both sides of a plane, the right one first or second.
fn divide_by<'a>(node: Node<'a>, split: &Split, right_first: bool) -> [Node<'a>; 2] {
    let first = if right_first {
        node.prims.len() - split.left
    } else {
        split.left
    };
    let (a, b) = node.room.split_at_mut(first);
    let (left, right) = if right_first { (b, a) } else { (a, b) };
    let centers = if split.chunks.is_empty() {
        partition(node.prims, &split.plane, left, right)
    } else {
        partition_parallel(node.prims, &split.plane, &split.chunks, left, right)
    };
    let order = if right_first { [1, 0] } else { [0, 1] };
    let sides = order.map(|side| Extents {
        boxes: split.boxes[side],
        centers: centers[side],
    });
    let moved = Node {
        prims: node.room,
        room: node.prims,
        ..node
    };
    cut(moved, first, sides)
}

/// Extents of `prims`, by chunks in parallel.
fn extents(prims: &[Prim]) -> Extents {
    if prims.len() <= CHUNK {
        return Extents::of(prims);
    }
    let (a, b) = prims.split_at(prims.len().div_ceil(CHUNK) / 2 * CHUNK);
    let (a, b) = join(|| extents(a), || extents(b));
    a.union(b)
}

/// Half the triangles to each side, in their present order: no plane tells them apart, or the levels run out.
fn halve(node: Node<'_>) -> [Node<'_>; 2] {
    let left = node.prims.len() / 2;
    let sides = [extents(&node.prims[..left]), extents(&node.prims[left..])];
    cut(node, left, sides)
}

/// Two nodes from one whose first `left` triangles go left.
fn cut(node: Node<'_>, left: usize, [a, b]: [Extents; 2]) -> [Node<'_>; 2] {
    let (prims_a, prims_b) = node.prims.split_at_mut(left);
    let (room_a, room_b) = node.room.split_at_mut(left);
    let [slot_a, slot_b] = node.slot.split(left);
    let sides = [(prims_a, room_a, slot_a, a), (prims_b, room_b, slot_b, b)];
    sides.map(|(prims, room, slot, extents)| Node {
        prims,
        room,
        slot,
        extents,
        depth: node.depth + 1,
    })
}

/// Copies `from` into `left` and `right`, which it fills exactly, and returns the bounds of their centres.
#[inline(never)]
pub(crate) fn partition(
    from: &[Prim],
    plane: &Plane,
    left: &mut [Prim],
    right: &mut [Prim],
) -> [Bounds; 2] {
    let mut centers = [Bounds::EMPTY; 2];
    let mut next = [0; 2];
    for prim in from {
        let side = usize::from(!plane.is_left(prim));
        let to = if side == 0 { &mut *left } else { &mut *right };
        to[next[side]] = *prim;
        next[side] += 1;
    }
    for (centers, side) in centers.iter_mut().zip([left, right]) {
        for prim in side {
            centers.grow(&Bounds::of_point(prim.center()));
        }
    }
    centers
}

/// The same by chunks in parallel; `counts` are those of each chunk's bins.
pub(crate) fn partition_parallel(
    from: &[Prim],
    plane: &Plane,
    counts: &[Counts],
    left: &mut [Prim],
    right: &mut [Prim],
) -> [Bounds; 2] {
    if counts.len() == 1 {
        return partition(from, plane, left, right);
    }
    let (here, there) = counts.split_at(counts.len() / 2);
    let (first, second) = from.split_at(here.len() * CHUNK);
    let lefts: usize = here.iter().map(|c| plane.left_of(c)).sum();
    let (left_a, left_b) = left.split_at_mut(lefts);
    let (right_a, right_b) = right.split_at_mut(first.len() - lefts);
    let (a, b) = join(
        || partition_parallel(first, plane, here, left_a, right_a),
        || partition_parallel(second, plane, there, left_b, right_b),
    );
    [a[0].union(b[0]), a[1].union(b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::tests::sized;

    #[test]
    fn chunks_in_parallel_move_like_one_loop_and_keep_the_order() {
        let n = 3 * CHUNK + 17;
        let at = |i: usize| std::array::from_fn(|k| (i * (7919 + 31 * k) % 1009) as f32);
        let prim = |i: usize| Prim::new(&sized(at(i), [0.0; 3]), i as u32);
        let prims: Vec<_> = (0..n).map(prim).collect();
        let extents = Extents::of(&prims);
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
            assert_eq!(found.aabb(), Extents::of(side).centers.aabb());
        }
    }
}
