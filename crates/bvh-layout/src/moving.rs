//! What of a tree must be done again when its scene moves: lists beside the record or the treelets.

use crate::{Topology, Treelets};
use geom::StaticParts;
use rayon::prelude::*;
use std::ops::Range;

/// Nodes that one task looks at.
const CHUNK: usize = 1 << 13;

/// What has a triangle below that moves. All else has the same box at every pose.
///
/// A record's lists are its leaves by rank, then for each level that has any, root first, inner nodes by their number among
/// inner nodes. Those of treelets are their numbers, for each level, that of the triangles first. Each list rises.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moving {
    /// The lists, one after the other, as they are handed over.
    pub words: Vec<u32>,
    /// Where each list lies among [`Moving::words`].
    pub lists: Vec<Range<usize>>,
    /// Active triangles of zero area below nothing that is listed.
    pub degenerate_elsewhere: u32,
}

impl Moving {
    /// Of a record. `None` where lists do not pay: more than half of all nodes move; see [`StaticParts::pays`].
    #[must_use]
    pub fn of(tree: &Topology, parts: &StaticParts) -> Option<Self> {
        let (is_static, triangles) = (&parts.triangles, tree.leaf_triangles());
        assert_eq!(is_static.len(), tree.triangle_count(), "another scene");
        let moves = |&rank: &u32| !is_static[triangles[rank as usize] as usize];
        let ranks = (0..tree.leaf_count() as u32).into_par_iter();
        let mut words: Vec<u32> = ranks.with_min_len(CHUNK).filter(moves).collect();
        let leaves = words.len();
        if !StaticParts::pays(leaves, tree.leaf_count()) {
            return None;
        }
        let inner = tree.bottom_up(false, |rank| moves(&rank), |a, b| a || b);
        let numbers = (0..inner.len() as u32).into_par_iter().with_min_len(CHUNK);
        words.par_extend(numbers.filter(|&k| inner[k as usize]));
        if !StaticParts::pays(words.len(), tree.node_count()) {
            return None;
        }
        // Inner nodes rise, so that a level's are neighbours.
        let place = |end: u32| leaves + words[leaves..].partition_point(|&k| k < end);
        let levels = tree.levels();
        let levels = levels.map(|level| place(level.start)..place(level.end));
        let levels = levels.filter(|list| !list.is_empty());
        Some(Self {
            lists: std::iter::once(0..leaves).chain(levels).collect(),
            words,
            degenerate_elsewhere: parts.degenerate.len() as u32,
        })
    }

    /// Of treelets. `None` where lists do not pay: more than half of all treelets move.
    pub(crate) fn of_treelets(tree: &Treelets, parts: &StaticParts) -> Option<Self> {
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

    /// The first list: of a record, its leaves. Empty if there is none.
    pub fn leaves(&self) -> &[u32] {
        let first = self.lists.first().cloned();
        &self.words[first.unwrap_or_default()]
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
    use crate::NodeRank;
    use crate::tests::{chain, parts, random_tree, record, scene, shapes};
    use std::collections::BTreeSet;

    /// The lists, which make up all words.
    fn lists(moving: &Moving) -> Vec<Vec<u32>> {
        let lists = moving.lists.iter();
        let lists: Vec<_> = lists.map(|l| moving.words[l.clone()].to_vec()).collect();
        assert_eq!(lists.concat(), moving.words);
        lists
    }

    /// Word for word what a record's lists mean: a node moves if a leaf below it does.
    fn expected_of_record(tree: &Topology, parts: &StaticParts) -> Vec<Vec<u32>> {
        let nodes = tree.node_count() as u32;
        let mut moves = vec![false; nodes as usize];
        for node in (0..nodes).rev() {
            let rank = tree.ranks().of(node);
            moves[node as usize] = match rank.leaf() {
                Some(leaf) => !parts.triangles[tree.leaf_triangles()[leaf as usize] as usize],
                None => {
                    let mut children = Topology::children_of_inner(rank.rank()).into_iter();
                    children.any(|child| moves[child as usize])
                }
            };
        }
        let all = (0..nodes).filter(|&node| moves[node as usize]);
        let (leaves, inner): (Vec<_>, Vec<_>) = all
            .map(|node| tree.ranks().of(node))
            .partition(|node| node.leaf().is_some());
        let ranks = |of: &[NodeRank]| of.iter().map(|node| node.rank()).collect::<Vec<_>>();
        let (leaves, inner) = (ranks(&leaves), ranks(&inner));
        let within = |level: Range<u32>| inner.iter().copied().filter(move |k| level.contains(k));
        let levels = tree.levels().map(|level| within(level).collect::<Vec<_>>());
        let levels = levels.filter(|list| !list.is_empty());
        std::iter::once(leaves).chain(levels).collect()
    }

    fn check_record(tree: &Topology, parts: &StaticParts) {
        let expected = expected_of_record(tree, parts);
        let found = Moving::of(tree, parts).map(|moving| lists(&moving));
        let (leaves, all) = (expected[0].len(), expected.concat().len());
        if 2 * leaves > tree.leaf_count() || all >= tree.leaf_count() {
            assert!(found.is_none() || tree.leaf_count() == 0);
        } else {
            assert_eq!(found, Some(expected));
        }
    }

    #[test]
    fn lists_hold_what_moves_and_its_ancestors() {
        for tree in shapes() {
            let (record, all) = (record(&tree), scene(&tree));
            for every in [1, 2, 3, 7, 1000] {
                check_record(&record, &parts(all, |t| t % every == 1));
            }
        }
        let tree = random_tree(3 * CHUNK, 8);
        let (record, all) = (record(&tree), scene(&tree));
        check_record(&record, &parts(all, |t| t % 5 == 0));
        check_record(&record, &parts(all, |t| t < 300));
        check_record(&record, &parts(all, |t| t as usize == all - 1));
    }

    /// Word for word what lists of treelets mean, by a walk from the triangles up, row by row.
    fn expected_of_treelets(tree: &Treelets, parts: &StaticParts) -> Vec<Vec<u32>> {
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
                let expected = expected_of_treelets(&treelets, &parts);
                let listed = treelets.clone().with_moving(&parts);
                let found = listed.moving.as_ref().map(lists);
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
                let bytes = listed.moving.as_ref().map_or(0, |m| 4 * m.words.len());
                assert_eq!(listed.bytes() - treelets.bytes(), bytes);
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
        assert_eq!(none.lists, [0..0, 0..0]);
        assert_eq!(of(|t| t % 3 == 0), None);
        let empty = Treelets::default().with_moving(&StaticParts::default());
        assert!(empty.moving.unwrap().lists.is_empty());
    }
}
