//! Nodes of few triangles: every plane between two neighbours along an axis, at several moments, is weighed.

use super::lanes::{Boxes, Ruler};
use super::prims::Prims;

/// The most triangles of a node cut here.
pub(super) const MOST: usize = 16;

/// Halving wins over a plane that is better by rounding alone, so that equal boxes make a balanced tree.
const NEARLY: f32 = 1.0 + 1e-5;

/// Puts `ids` (2 to [`MOST`]) in the order of the best plane, and gives how many of them go left.
#[inline(never)]
pub(super) fn cut(ids: &mut [u32], prims: &Prims) -> usize {
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
    let mut best_order = [0; MOST];
    best_order[..n].copy_from_slice(ids);
    for axis in 0..3 {
        let mut last = [u32::MAX; MOST];
        for &lane in &prims.tried {
            let order = sorted(ids, |id| prims.get(id).center(axis, lane));
            // Neighbours mostly move alike, and then one moment says it all.
            if order == last {
                continue;
            }
            let found = best_cut(&order[..n], prims, ruler);
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
fn sorted(ids: &[u32], key: impl Fn(u32) -> f32) -> [u32; MOST] {
    let mut order = [0; MOST];
    let mut keys = [0.0; MOST];
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

/// The least cost of a cut of `order`, and how many go left.
fn best_cut(order: &[u32], prims: &Prims, ruler: Ruler<'_>) -> (f32, usize) {
    let n = order.len();
    let mut costs = [0.0; MOST];
    let mut b = Boxes::EMPTY;
    for left in (1..n).rev() {
        b.grow(prims.get(order[left]));
        costs[left] = ruler.half_area(&b) * (n - left) as f32;
    }
    let mut best = (f32::INFINITY, n / 2);
    b = Boxes::EMPTY;
    for left in 1..n {
        b.grow(prims.get(order[left - 1]));
        costs[left] += ruler.half_area(&b) * left as f32;
        if costs[left] < best.0 {
            best = (costs[left], left);
        }
    }
    if costs[n / 2] <= best.0 * NEARLY {
        best.1 = n / 2;
    }
    best
}
