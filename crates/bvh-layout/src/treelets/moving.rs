//! Which treelets must be done again when the scene moves.

use super::Treelets;
use geom::StaticParts;
use rayon::prelude::*;
use std::ops::Range;

/// Treelets with a triangle below that moves. In all others every box stays the same at every pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MovingTreelets {
    /// Their numbers, rising, as they are handed over.
    pub words: Vec<u32>,
    /// For each level, that of the triangles first, where its treelets lie among [`MovingTreelets::words`].
    pub levels: Vec<Range<usize>>,
    /// Active triangles of zero area in treelets that do not move.
    pub degenerate_elsewhere: u32,
}

impl MovingTreelets {
    /// `None` where lists do not pay: more than half of all treelets move; see [`StaticParts::pays`].
    pub(super) fn of(tree: &Treelets, parts: &StaticParts) -> Option<Self> {
        let (mut words, mut levels) = (Vec::new(), Vec::<Range<usize>>::new());
        for treelets in &tree.levels {
            let found: Vec<u32> = match levels.last() {
                None => with_triangles_that_move(tree, treelets.clone(), parts),
                Some(below) => parents(tree, &words[below.clone()]),
            };
            levels.push(words.len()..words.len() + found.len());
            words.extend(found);
            if !StaticParts::pays(words.len(), tree.treelet_count()) {
                return None;
            }
        }
        let lowest = levels.first().cloned().unwrap_or_default();
        let among = degenerate_among(tree, &words[lowest], parts);
        Some(Self {
            words,
            levels,
            degenerate_elsewhere: (parts.degenerate.len() - among) as u32,
        })
    }
}

fn with_triangles_that_move(tree: &Treelets, lowest: Range<u32>, parts: &StaticParts) -> Vec<u32> {
    let moves = |word: &u32| !parts.triangles[(word & !Treelets::SHARED) as usize];
    lowest
        .into_par_iter()
        .filter(|&number| tree.triangles(number as usize).iter().any(moves))
        .collect()
}

/// Those of the next level that stand on roots of these.
fn parents(tree: &Treelets, below: &[u32]) -> Vec<u32> {
    let parents = below.iter().map(|&t| tree.treelet(t as usize).parent);
    let mut parents: Vec<u32> = parents.collect();
    parents.dedup();
    parents
}

/// Static triangles of zero area in these treelets of the lowest level.
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
    use crate::tests::{chain, parts, random_tree, scene};
    use std::collections::BTreeSet;

    /// Word for word what the lists mean, by a walk from the triangles up, row by row.
    fn expected(tree: &Treelets, parts: &StaticParts) -> Vec<Vec<u32>> {
        let mut rows = BTreeSet::new();
        let mut lists = Vec::new();
        for (number, level) in tree.levels.iter().enumerate() {
            let mut list = Vec::new();
            for treelet in level.clone() {
                let entry = tree.treelet(treelet as usize);
                let mut leaves = 0..entry.leaf_count;
                let moves = leaves.any(|i| match number {
                    0 => {
                        let at = tree.triangles_at() + (entry.first_leaf + i) as usize;
                        !parts.triangles[(tree.words()[at] & !Treelets::SHARED) as usize]
                    }
                    _ => rows.contains(&(entry.first_leaf + 2 * i)),
                });
                if moves {
                    list.push(treelet);
                    rows.extend((0..entry.root_count).map(|i| entry.root_row + 2 * i));
                }
            }
            lists.push(list);
        }
        lists
    }

    #[test]
    fn lists_hold_treelets_with_what_moves_and_those_above() {
        for tree in [random_tree(150_000, 9), chain(40_000), random_tree(900, 2)] {
            let treelets = Treelets::of_tree(&tree);
            let order = tree.order();
            for (first, count) in [(0, 1), (order.len() / 2, 300), (order.len() - 1, 1)] {
                let moves: BTreeSet<u32> = order[first..].iter().take(count).copied().collect();
                let parts = parts(scene(&tree), |t| moves.contains(&t));
                let expected = expected(&treelets, &parts);
                let listed = treelets.clone().with_moving(&parts);
                let found = listed.moving.as_ref().map(|m| {
                    let levels = m.levels.iter();
                    let lists = levels.map(|l| m.words[l.clone()].to_vec());
                    lists.collect::<Vec<_>>()
                });
                let many = 2 * expected.concat().len() > treelets.treelet_count();
                let moving = expected.concat();
                let parents = moving.iter().map(|&t| listed.treelet(t as usize).parent);
                let parents: Vec<_> = parents.collect();
                for number in 0..listed.treelet_count() {
                    let below = parents.iter().filter(|&&p| p == number as u32).count();
                    let told = listed.treelet(number).moving_children as usize;
                    assert_eq!(told, below * usize::from(!many), "treelet {number}");
                }
                assert_eq!(found, (!many).then_some(expected));
                let lists = listed.moving.as_ref().map_or(0, |m| 4 * m.words.len());
                assert_eq!(listed.bytes() - treelets.bytes(), lists);
            }
        }
    }

    #[test]
    fn where_all_stands_still_lists_are_empty_and_where_most_moves_there_are_none() {
        let tree = random_tree(20_000, 4);
        let treelets = Treelets::of_tree(&tree);
        let of = |moves: fn(u32) -> bool| {
            let parts = parts(scene(&tree), moves);
            treelets.clone().with_moving(&parts).moving
        };
        let none = of(|_| false).unwrap();
        assert!(none.words.is_empty());
        assert_eq!(none.levels, [0..0, 0..0]);
        assert_eq!(of(|t| t % 3 == 0), None);
        let empty = Treelets::default().with_moving(&StaticParts::default());
        assert!(empty.moving.unwrap().levels.is_empty());
    }
}
