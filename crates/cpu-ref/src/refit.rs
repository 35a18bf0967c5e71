//! Boxes of leaves to boxes of inner nodes, level by level, deepest first.

use crate::bvh2::Pair;
use crate::pass::{Which, Window, pass};

/// Pairs that one task handles.
const RUN: usize = 2048;

/// Gives every inner node of these pairs, which lie on one level, the least box round its children. Only minima and
/// maxima: nothing rounds. What comes from place `end` on is up to date and begins with pair `first`.
///
/// Returns the sum of the half areas of the pairs' nodes.
pub(crate) fn refit_level(
    pairs: &mut [Pair],
    (end, first): (usize, usize),
    which: Which<'_>,
) -> f64 {
    let (level, below) = pairs.split_at_mut(end);
    pass(which, Window::new(0, level), RUN, &|which, mut pairs| {
        let refit = |sum, pair: &mut Pair| refit_pair(pair, below, first, sum);
        match which {
            Which::All(range) => pairs.slice(range).iter_mut().fold(0.0, refit),
            Which::Listed(list) => {
                let listed = list.iter();
                listed.fold(0.0, |sum, &pair| refit(sum, &mut pairs[pair as usize]))
            }
        }
    })
}

/// Adds the half areas of the pair's nodes to `sum`. `below` begins with pair `first`.
#[inline(always)]
fn refit_pair(pair: &mut Pair, below: &[Pair], first: usize, mut sum: f64) -> f64 {
    for lane in 0..2 {
        let link = pair.links[lane];
        if link.is_inner() {
            let [min, max] = below[link.index() - first].union();
            pair.set_bounds(lane, min, max);
        }
        sum += pair.bounds(lane).half_area();
    }
    sum
}
