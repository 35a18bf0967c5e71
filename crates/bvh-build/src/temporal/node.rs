//! The recursion: one node, its plane, its two children.

use super::bins::{Extents, Plane, best_plane};
use super::prims::Prims;
use super::sweep;
use crate::node::fits;
use crate::{BuildError, Cancel};
use rayon::join;

/// Nodes of more triangles than this build their children in parallel and ask whether to go on.
const PARALLEL: usize = 1024;
/// A plane is chosen by so many triangles of a larger node, evenly taken from all.
const SAMPLE: usize = 1 << 12;

/// A node to build: its triangles, room of the same size, and where its part of the tree goes.
pub(super) struct TemporalNode<'a> {
    /// Becomes the order of the leaves.
    pub(super) order: &'a mut [u32],
    pub(super) room: &'a mut [u32],
    pub(super) left_leaves: &'a mut [u32],
    pub(super) depth: u32,
}

/// Builds the subtree of `node`, which holds one triangle at least.
pub(super) fn build(
    prims: &Prims,
    node: TemporalNode<'_>,
    cancel: &Cancel,
) -> Result<(), BuildError> {
    let leaves = node.order.len();
    if leaves == 1 {
        return Ok(());
    }
    if leaves > PARALLEL && cancel.is_cancelled() {
        return Err(BuildError::Cancelled);
    }
    let [left, right] = divide(prims, node);
    if leaves > PARALLEL {
        let (a, b) = join(
            || build(prims, left, cancel),
            || build(prims, right, cancel),
        );
        return a.and(b);
    }
    build(prims, left, cancel)?;
    build(prims, right, cancel)
}

fn divide<'a>(prims: &Prims, node: TemporalNode<'a>) -> [TemporalNode<'a>; 2] {
    let n = node.order.len();
    let left = if n <= sweep::MOST {
        sweep::cut(node.order, prims)
    } else {
        match find_plane(prims, node.order) {
            Some(plane) => partition(prims, node.order, node.room, &plane),
            None => n / 2,
        }
    };
    // Halving the present order keeps within the levels that are left.
    let fit = 0 < left && left < n && fits(left.max(n - left), node.depth + 1);
    cut(node, if fit { left } else { n / 2 })
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

/// Two nodes from one whose first `left` triangles go left.
fn cut(node: TemporalNode<'_>, left: usize) -> [TemporalNode<'_>; 2] {
    let (order_a, order_b) = node.order.split_at_mut(left);
    let (room_a, room_b) = node.room.split_at_mut(left);
    node.left_leaves[0] = left as u32;
    let (inner_a, inner_b) = node.left_leaves[1..].split_at_mut(left - 1);
    let depth = node.depth + 1;
    [
        TemporalNode {
            order: order_a,
            room: room_a,
            left_leaves: inner_a,
            depth,
        },
        TemporalNode {
            order: order_b,
            room: room_b,
            left_leaves: inner_b,
            depth,
        },
    ]
}
