//! Boxes of leaves to boxes of inner nodes, level by level, deepest first.

use crate::moving::MovingNodes;
use crate::nodes::{Nodes, Pair};
use rayon::prelude::*;

/// Levels narrower than this many pairs are not worth a task.
const WIDE: usize = 2 * RUN;
/// Pairs that one task handles, and that one partial sum covers.
const RUN: usize = 2048;

/// Gives every inner node the least box round its children. Only minima and maxima: nothing rounds.
///
/// Returns the sum of all nodes' half areas. `sums` is memory for partial sums,
/// one a run, so that the sum has the same bits for every number of threads.
pub(crate) fn refit(nodes: &mut Nodes, sums: &mut Vec<f64>) -> f64 {
    let mut total = 0.0;
    for level in nodes.levels.iter().rev() {
        let (upper, below) = nodes.pairs.split_at_mut(level.end);
        let (first, pairs) = (level.end, &mut upper[level.clone()]);
        sums.clear();
        sums.resize(pairs.len().div_ceil(RUN), 0.0);
        let refit_run =
            |(sum, pairs): (&mut f64, &mut [Pair])| *sum = refit_run(pairs, below, first);
        if pairs.len() < WIDE {
            sums.iter_mut()
                .zip(pairs.chunks_mut(RUN))
                .for_each(refit_run);
        } else {
            sums.par_iter_mut()
                .zip(pairs.par_chunks_mut(RUN))
                .for_each(refit_run);
        }
        total += sums.iter().sum::<f64>();
    }
    total
}

/// The same for pairs that move alone. Returns the sum of their nodes' half
/// areas, with the same bits for every number of threads.
pub(crate) fn refit_moving(nodes: &mut Nodes, moving: &MovingNodes) -> f64 {
    let mut total = 0.0;
    for level in moving.levels.iter().rev() {
        let list = &moving.pairs[level.clone()];
        // Children lie on a later level, so behind every pair of this one.
        let end = list.last().map_or(0, |&last| last as usize + 1);
        let (pairs, below) = nodes.pairs.split_at_mut(end);
        total += refit_list(list, (pairs, 0), (below, end));
    }
    total
}

/// Halves a list until it is short; slices come with the pair they begin with.
fn refit_list(
    list: &[u32],
    (pairs, first): (&mut [Pair], usize),
    (below, end): (&[Pair], usize),
) -> f64 {
    if list.len() <= RUN {
        let mut sum = 0.0;
        for &p in list {
            let at = p as usize - first;
            sum += refit_run(&mut pairs[at..=at], below, end);
        }
        return sum;
    }
    let (left, right) = list.split_at(list.len() / 2);
    let middle = right[0] as usize;
    let (left_pairs, right_pairs) = pairs.split_at_mut(middle - first);
    let (left, right) = rayon::join(
        || refit_list(left, (left_pairs, first), (below, end)),
        || refit_list(right, (right_pairs, middle), (below, end)),
    );
    left + right
}

/// Refits neighbouring pairs of one level; `below` begins with pair `first`. Returns the sum of half areas.
fn refit_run(pairs: &mut [Pair], below: &[Pair], first: usize) -> f64 {
    let mut sum = 0.0;
    for pair in pairs {
        for lane in 0..2 {
            let link = pair.links[lane];
            if !link.is_leaf() && link != crate::nodes::Link::ROOT {
                let [min, max] = below[link.index() - first].union();
                pair.set_bounds(lane, min, max);
            }
            sum += pair.bounds(lane).half_area();
        }
    }
    sum
}
