//! What of a tree must be done again when its scene moves: lists beside the record.

use crate::Topology;
use geom::StaticParts;
use rayon::prelude::*;
use std::ops::Range;

/// Nodes that one task looks at.
const CHUNK: usize = 1 << 13;

/// Leaves whose triangle moves, and inner nodes with such a leaf below.
///
/// All other nodes have the same box at every pose. Both lists rise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moving {
    /// Leaves by rank, then inner nodes by their number among inner nodes.
    words: Vec<u32>,
    leaves: usize,
    /// For each level that has moving inner nodes, root first, where they lie in [`Moving::inner`].
    pub levels: Vec<Range<usize>>,
    /// Active triangles of zero area among the leaves that do not move: all static ones.
    pub degenerate_elsewhere: u32,
}

impl Moving {
    /// The lists for a scene's tree. `None` where nothing is static or lists do
    /// not pay: more than half of all nodes move; see [`StaticParts::pays`].
    #[must_use]
    pub fn of(tree: &Topology, parts: &StaticParts) -> Option<Self> {
        let is_static = &parts.triangles;
        assert_eq!(is_static.len(), tree.triangle_count(), "another scene");
        let leaves = tree.leaf_triangles().par_iter().with_min_len(CHUNK);
        let moving = leaves.filter(|&&t| !is_static[t as usize]).count();
        if !StaticParts::pays(moving, tree.leaf_count()) {
            return None;
        }
        let moves = flags(tree, is_static);
        let [mut words, inner] = lists(tree, &moves);
        let leaves = words.len();
        words.extend(inner);
        StaticParts::pays(words.len(), tree.node_count()).then(|| Self {
            levels: levels(tree, &words[leaves..]),
            words,
            leaves,
            degenerate_elsewhere: parts.degenerate.len() as u32,
        })
    }

    /// Both lists as they are handed over: [`Moving::leaves`], then [`Moving::inner`].
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Leaves whose triangle moves, by their place in [`Topology::leaf_triangles`].
    pub fn leaves(&self) -> &[u32] {
        &self.words[..self.leaves]
    }

    /// Inner nodes with a moving leaf below, by their place among inner nodes.
    pub fn inner(&self) -> &[u32] {
        &self.words[self.leaves..]
    }
}

/// For each node, whether it moves. From the deepest level up, since children tell.
fn flags(tree: &Topology, is_static: &[bool]) -> Vec<bool> {
    let mut flags = vec![false; tree.node_count()];
    let (triangles, ranks) = (tree.leaf_triangles(), tree.ranks());
    let levels: Vec<Range<u32>> = tree.levels().map(|level| level.nodes).collect();
    for level in levels.iter().rev() {
        let (upper, below) = flags.split_at_mut(level.end as usize);
        let level_flags = &mut upper[level.start as usize..];
        let chunks = level_flags.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, flags)| {
            let first = level.start + (chunk * CHUNK) as u32;
            for (flag, node) in flags.iter_mut().zip(first..) {
                let node = ranks.of(node);
                *flag = match node.leaf() {
                    Some(rank) => !is_static[triangles[rank as usize] as usize],
                    None => Topology::children_of_inner(node.rank())
                        .iter()
                        .any(|c| below[(c - level.end) as usize]),
                };
            }
        });
    }
    flags
}

/// Leaves by rank and inner nodes by number, of those that move.
fn lists(tree: &Topology, moves: &[bool]) -> [Vec<u32>; 2] {
    let (ranks, chunks) = (tree.ranks(), moves.par_chunks(CHUNK).enumerate());
    let found: Vec<[Vec<u32>; 2]> = chunks
        .map(|(chunk, moves)| {
            let mut lists = [Vec::new(), Vec::new()];
            let nodes = moves.iter().zip((chunk * CHUNK) as u32..);
            for (_, node) in nodes.filter(|(moves, _)| **moves) {
                let node = ranks.of(node);
                lists[usize::from(node.leaf().is_none())].push(node.rank());
            }
            lists
        })
        .collect();
    [0, 1].map(|kind| found.iter().flat_map(|f| &f[kind]).copied().collect())
}

/// Cuts a rising list of inner nodes where levels end.
fn levels(tree: &Topology, inner: &[u32]) -> Vec<Range<usize>> {
    let place = |end: u32| inner.partition_point(|&k| k < end);
    tree.levels()
        .map(|level| place(level.inner.start)..place(level.inner.end))
        .filter(|range| !range.is_empty())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{parts, random_tree, record, scene, shapes};

    /// Word for word what the lists mean: a node moves if a leaf below it does.
    fn check(tree: &Topology, parts: &StaticParts) {
        let mut moves = vec![false; tree.node_count()];
        let (mut leaves, mut inner) = (Vec::new(), Vec::new());
        for node in (0..tree.node_count() as u32).rev() {
            let rank = tree.ranks().of(node);
            let (list, its_moves) = match rank.leaf() {
                Some(leaf) => {
                    let triangle = tree.leaf_triangles()[leaf as usize];
                    (&mut leaves, !parts.triangles[triangle as usize])
                }
                None => {
                    let children = Topology::children_of_inner(rank.rank());
                    (&mut inner, children.iter().any(|&c| moves[c as usize]))
                }
            };
            moves[node as usize] = its_moves;
            list.extend(its_moves.then_some(rank.rank()));
        }
        leaves.reverse();
        inner.reverse();
        let found = Moving::of(tree, parts);
        if 2 * leaves.len() > tree.leaf_count() || leaves.len() + inner.len() >= tree.leaf_count() {
            assert!(found.is_none() || tree.leaf_count() == 0);
            return;
        }
        let found = found.unwrap();
        assert_eq!((found.leaves(), found.inner()), (&leaves[..], &inner[..]));
        assert_eq!(found.words(), [leaves, inner].concat());
        let mut end = 0;
        for level in &found.levels {
            assert!(level.start == end && !level.is_empty());
            let nodes = &found.inner()[level.clone()];
            let holds = |l: &crate::Level| nodes.iter().all(|k| l.inner.contains(k));
            assert!(tree.levels().any(|l| holds(&l)));
            end = level.end;
        }
        assert_eq!(end, found.inner().len());
    }

    #[test]
    fn lists_hold_what_moves_and_its_ancestors() {
        for tree in shapes() {
            let (record, all) = (record(&tree), scene(&tree));
            for every in [1, 2, 3, 7, 1000] {
                check(&record, &parts(all, |t| t % every == 1));
            }
        }
        let tree = random_tree(3 * CHUNK, 8);
        let (record, all) = (record(&tree), scene(&tree));
        check(&record, &parts(all, |t| t % 5 == 0));
        check(&record, &parts(all, |t| t < 300));
        check(&record, &parts(all, |t| t as usize == all - 1));
    }
}
