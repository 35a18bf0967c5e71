//! The recursion: one node, its plane, its two children.

use super::bins::{BINS, Extents, Plane, best_plane, cuts};
use super::lanes::{Boxes, Ruler};
use super::prims::Prims;
use crate::node::fits;
use crate::small::NEARLY;
use crate::tree::SubtreeSlot;
use crate::{BuildError, Cancel, join_if};

/// Nodes of more triangles than this build their children in parallel and ask whether to go on.
const PARALLEL: usize = 1024;
/// A plane is chosen by so many triangles of a larger node, evenly taken from all.
const SAMPLE: usize = 1 << 12;
/// Of nodes of so many triangles at most, every plane between two neighbours along an axis, at several moments, is weighed.
const FEW: usize = BINS;

/// A node to build: where its part of the tree goes, and room of the same size.
pub(super) struct TemporalNode<'a> {
    /// Its triangles become the order of the leaves.
    pub(super) slot: SubtreeSlot<'a>,
    pub(super) room: &'a mut [u32],
    pub(super) depth: u32,
}

/// Builds the subtree of `node`, which holds one triangle at least.
pub(super) fn build(
    prims: &Prims,
    node: TemporalNode<'_>,
    cancel: &Cancel,
) -> Result<(), BuildError> {
    let leaves = node.slot.order.len();
    if leaves == 1 {
        return Ok(());
    }
    if leaves > PARALLEL && cancel.is_cancelled() {
        return Err(BuildError::Cancelled);
    }
    let [left, right] = divide(prims, node);
    let (a, b) = join_if(
        leaves > PARALLEL,
        || build(prims, left, cancel),
        || build(prims, right, cancel),
    );
    a.and(b)
}

fn divide<'a>(prims: &Prims, node: TemporalNode<'a>) -> [TemporalNode<'a>; 2] {
    let n = node.slot.order.len();
    let left = if n <= FEW {
        sweep(node.slot.order, prims)
    } else {
        match find_plane(prims, node.slot.order) {
            Some(plane) => partition(prims, node.slot.order, node.room, &plane),
            None => n / 2,
        }
    };
    // Halving the present order keeps within the levels that are left.
    let fit = 0 < left && left < n && fits(left.max(n - left), node.depth + 1);
    let left = if fit { left } else { n / 2 };
    let [a, b] = node.slot.split(left);
    let (room_a, room_b) = node.room.split_at_mut(left);
    [(a, room_a), (b, room_b)].map(|(slot, room)| TemporalNode {
        slot,
        room,
        depth: node.depth + 1,
    })
}

/// The best plane of the moments that are tried, or none if at each of them all centres coincide.
fn find_plane(prims: &Prims, order: &[u32]) -> Option<Plane> {
    let some = || order.iter().step_by(order.len().div_ceil(SAMPLE));
    let extents = Extents::of(some(), prims);
    let plane = |lane| best_plane(some(), prims, &extents, lane);
    let planes = prims.tried.iter().filter_map(|&lane| plane(lane));
    let best = planes.reduce(|a, b| if b.0 < a.0 { b } else { a })?;
    Some(best.1)
}

/// Brings those left of the plane to the front, all in the order they came, and counts them.
fn partition(prims: &Prims, order: &mut [u32], room: &mut [u32], plane: &Plane) -> usize {
    let (mut left, mut right) = (0, 0);
    for i in 0..order.len() {
        let id = order[i];
        if plane.is_left(prims.get(id)) {
            order[left] = id;
            left += 1;
        } else {
            room[right] = id;
            right += 1;
        }
    }
    order[left..].copy_from_slice(&room[..right]);
    left
}

/// Puts `ids` (2 to [`FEW`]) in the order of the best plane, and gives how many of them go left.
#[inline(never)]
fn sweep(ids: &mut [u32], prims: &Prims) -> usize {
    let n = ids.len();
    if n == 2 {
        return 1;
    }
    let mut node = Boxes::EMPTY;
    for &id in &*ids {
        node.grow(prims.get(id));
    }
    let ruler = Ruler::new(&node, &prims.weights);
    let mut best = (f32::INFINITY, n / 2);
    let mut best_order = [0; FEW];
    best_order[..n].copy_from_slice(ids);
    for axis in 0..3 {
        let mut last = [u32::MAX; FEW];
        for &lane in &prims.tried {
            let order = sorted(ids, |id| prims.get(id).center(axis, lane));
            // Neighbours mostly move alike, and then one moment says it all.
            if order == last {
                continue;
            }
            let (costs, mut found) = cuts(n, |i| (prims.get(order[i]), 1), ruler);
            if costs[n / 2] <= found.0 * NEARLY {
                found.1 = n / 2;
            }
            if found.0 < best.0 {
                (best, best_order) = (found, order);
            }
            last = order;
        }
    }
    ids.copy_from_slice(&best_order[..n]);
    best.1
}

/// The ids by rising key, equal ones in the order they came.
fn sorted(ids: &[u32], key: impl Fn(u32) -> f32) -> [u32; FEW] {
    let mut order = [0; FEW];
    let mut keys = [0.0; FEW];
    for (i, &id) in ids.iter().enumerate() {
        let k = key(id);
        let mut place = i;
        while place > 0 && keys[place - 1] > k {
            (keys[place], order[place]) = (keys[place - 1], order[place - 1]);
            place -= 1;
        }
        (keys[place], order[place]) = (k, id);
    }
    order
}
