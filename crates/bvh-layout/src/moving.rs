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

/// Cuts a rising list of inner nodes where levels end.
fn levels(tree: &Topology, inner: &[u32]) -> Vec<Range<usize>> {
    let place = |end: u32| inner.partition_point(|&k| k < end);
    tree.levels()
        .map(|level| place(level.start)..place(level.end))
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
        let mut end = 0;
        for level in &found.levels {
            assert!(level.start == end && !level.is_empty());
            let nodes = &found.inner()[level.clone()];
            let holds = |level: Range<u32>| nodes.iter().all(|k| level.contains(k));
            assert!(tree.levels().any(holds));
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
