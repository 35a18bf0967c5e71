//! Lists of the treelets to refit when the scene moves.

use crate::Treelets;
use geom::StaticParts;
use rayon::prelude::*;
use std::ops::Range;

/// Treelets with a moving triangle below. All others have the same boxes at every pose.
///
/// Each level has a list of treelet numbers in ascending order, the level of the triangles first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moving {
    /// The concatenated lists.
    pub words: Vec<u32>,
    /// Range of each list in [`Moving::words`].
    pub lists: Vec<Range<usize>>,
    /// Number of active zero-area triangles in treelets that are not listed.
    pub degenerate_elsewhere: u32,
}

impl Moving {
    /// Lists the moving treelets. Returns `None` if more than half of all treelets move.
    pub(crate) fn of(tree: &Treelets, parts: &StaticParts) -> Option<Self> {
        let (mut words, mut lists) = (Vec::new(), Vec::<Range<usize>>::new());
        for treelets in &tree.levels {
            let found: Vec<u32> = match lists.last() {
                None => with_triangles_that_move(tree, treelets.clone(), parts),
                Some(below) => parents(tree, &words[below.clone()]),
            };
            lists.push(words.len()..words.len() + found.len());
            words.extend(found);
            if !StaticParts::pays(words.len(), tree.treelet_count()) {
                return None;
            }
        }
        let lowest = lists.first().cloned().unwrap_or_default();
        let among = degenerate_among(tree, &words[lowest], parts);
        Some(Self {
            words,
            lists,
            degenerate_elsewhere: (parts.degenerate.len() - among) as u32,
        })
    }
}

fn with_triangles_that_move(tree: &Treelets, lowest: Range<u32>, parts: &StaticParts) -> Vec<u32> {
    // `parts.triangles` has one flag per triangle: `true` if it is static.
    let moves = |word: &u32| !parts.triangles[(word & !Treelets::SHARED) as usize];
    lowest
        .into_par_iter()
        .filter(|&number| tree.triangles(number as usize).iter().any(moves))
        .collect()
}

/// Returns the parents of the treelets `below`.
fn parents(tree: &Treelets, below: &[u32]) -> Vec<u32> {
    let parents = below.iter().map(|&t| tree.treelet(t as usize).parent);
    let mut parents: Vec<u32> = parents.collect();
    parents.dedup();
    parents
}

/// Counts the static zero-area triangles in `treelets`, which are on the lowest level.
fn degenerate_among(tree: &Treelets, treelets: &[u32], parts: &StaticParts) -> usize {
    if parts.degenerate.is_empty() {
        return 0;
    }
    let is_one = |word: &&u32| {
        let triangle = **word & !Treelets::SHARED;
        parts.degenerate.binary_search(&triangle).is_ok()
    };
    let triangles = treelets.iter().map(|&t| tree.triangles(t as usize));
    triangles.map(|t| t.iter().filter(is_one).count()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{chain, parts, random_tree, scene_triangle_count};
    use std::collections::BTreeSet;

    #[test]
    fn lists_hold_only_moving_paths() {
        for tree in [random_tree(150_000, 9), chain(40_000)] {
            let treelets = Treelets::of(&tree);
            let order = tree.order();
            let everywhere: Vec<u32> = order.iter().step_by(10_000).copied().collect();
            for moves in [&order[..1], &order[order.len() / 2..][..300], &everywhere] {
                let parts = parts(scene_triangle_count(&tree), |t| moves.contains(&t));
                let listed = treelets.clone().with_moving(&parts);
                let words = check_levels(&listed).len();
                assert!(words <= moves.len() * treelets.levels.len());
                assert_eq!(listed.bytes() - treelets.bytes(), 4 * words);
            }
        }
    }

    /// Checks that each list holds the parents of the list before, and that parents count their listed children.
    fn check_levels(tree: &Treelets) -> &[u32] {
        let Moving { words, lists, .. } = tree.moving.as_ref().unwrap();
        let parent = |&number: &u32| tree.treelet(number as usize).parent;
        for (below, above) in lists.iter().zip(&lists[1..]) {
            let parents: BTreeSet<_> = words[below.clone()].iter().map(parent).collect();
            assert!(parents.iter().eq(&words[above.clone()]));
        }
        for number in 0..tree.treelet_count() {
            let children = words.iter().filter(|t| parent(t) == number as u32);
            let stored = tree.treelet(number).moving_children as usize;
            assert_eq!(stored, children.count(), "treelet {number}");
        }
        words
    }

    #[test]
    fn lists_depend_on_moving_share() {
        let tree = random_tree(20_000, 4);
        let treelets = Treelets::of(&tree);
        let of = |moves: fn(u32) -> bool| {
            let parts = parts(scene_triangle_count(&tree), moves);
            treelets.clone().with_moving(&parts).moving
        };
        let none = of(|_| false).unwrap();
        assert!(none.words.is_empty());
        assert_eq!(none.lists, [0..0, 0..0]);
        assert_eq!(of(|t| t % 3 == 0), None);
        let empty = Treelets::default().with_moving(&StaticParts::default());
        assert!(empty.moving.unwrap().lists.is_empty());
    }
}
