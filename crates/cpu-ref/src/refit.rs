//! Boxes of leaves to boxes of inner nodes, level by level, deepest first.

use crate::nodes::{Nodes, Pair};
use rayon::prelude::*;

/// Levels narrower than this many pairs are not worth a task.
const WIDE: usize = 2 * RUN;
/// Pairs that one task handles, and that one partial sum covers.
const RUN: usize = 2048;

/// Gives every inner node the least box round its children. Only minima and maxima: nothing rounds.
///
/// Returns the tree's cost by the surface area heuristic: the sum of all nodes'
/// areas over the root's (MacDonald, Booth 1990); `None` if the root has no
/// area. `sums` is memory for partial sums, one a run, so that the cost has the
/// same bits for every number of threads.
pub(crate) fn refit(nodes: &mut Nodes, sums: &mut Vec<f64>) -> Option<f64> {
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
    let root = nodes.root().half_area();
    (root > 0.0).then(|| total / root)
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
