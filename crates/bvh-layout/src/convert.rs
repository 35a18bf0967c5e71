//! Converts a depth-first tree to a breadth-first record.
//!
//! Nodes of one level have the same order in preorder as in breadth-first order, so no queue of nodes is needed. One
//! preorder walk counts the nodes of each level, a second appends each node to its level. Both access memory
//! sequentially, in at most one stream per level. Both run in parallel over chunks of the preorder: the counts give
//! each chunk's range in every level.

use crate::treelets::Workspace;
use crate::validate::Header;
use crate::walk::Walk;
use crate::{Topology, Treelets};
use bvh_build::{BinaryTree, MAX_DEPTH};
use geom::Animation;
use rayon::prelude::*;

/// Number of depths at which an inner node may be.
const DEPTHS: usize = MAX_DEPTH as usize;
/// Number of inner nodes per chunk: large enough to amortize the cost of a chunk, small enough for many threads.
const CHUNK: usize = 1 << 14;

/// Converts trees. Keeps its scratch memory between calls.
#[derive(Debug, Default)]
pub struct Converter {
    /// One entry per chunk of the preorder.
    tallies: Vec<LevelCounts>,
    /// Two flags for each inner node in breadth-first order: bit 0 if the left child is a leaf, bit 1 for the right
    /// child.
    leaf_children: Vec<u8>,
    workspace: Workspace,
}

/// Memory of an old record and of its treelets, for reuse: see [`Topology::into_spare`]. Empty by default.
#[derive(Debug, Default)]
pub struct Spare {
    pub(crate) words: Vec<u32>,
    pub(crate) treelets: Vec<u32>,
}

impl Spare {
    /// Returns whether there is no memory to reuse.
    pub fn is_empty(&self) -> bool {
        self.words.capacity() == 0 && self.treelets.capacity() == 0
    }
}

/// Number of nodes that one chunk adds to each level.
#[derive(Clone, Debug)]
struct LevelCounts {
    /// Number of inner nodes at each depth.
    inner: [u32; DEPTHS],
    /// Number of leaf children, by the depth of the parent.
    leaves: [u32; DEPTHS],
}

impl Converter {
    /// Converts `tree` to a record for a scene of `triangle_count` triangles, in the memory of an old record.
    ///
    /// Runs in the rayon pool that the caller installed. The record does not depend on the number of threads. Uses 1
    /// byte of scratch memory per triangle.
    ///
    /// # Panics
    /// If `triangle_count` exceeds [`Animation::MAX_TRIANGLES`], if a triangle of the tree is not below it, or if the
    /// tree is deeper than [`MAX_DEPTH`].
    #[must_use]
    pub fn convert(&mut self, tree: &BinaryTree, triangle_count: usize, reuse: Spare) -> Topology {
        let mut words = reuse.words;
        assert!(
            triangle_count <= Animation::MAX_TRIANGLES,
            "{triangle_count} triangles are too many for a record"
        );
        self.count(tree);
        let inner = self.inner_per_level(tree);
        let header = Header {
            triangles: triangle_count as u32,
            leaves: tree.order().len() as u32,
            levels: inner.len() as u32,
        };
        // Reused memory is not cleared: every word is written below.
        words.resize(header.record_words(), 0);
        let (head, body) = words.split_at_mut(Topology::HEADER_WORDS);
        head.copy_from_slice(&header.words());
        let (level_table, body) = body.split_at_mut(inner.len());
        level_table.copy_from_slice(&inner);
        let (bits, body) = body.split_at_mut(header.bit_words());
        let (ranks, leaf_triangles) = body.split_at_mut(header.bit_words());
        let greatest = self.scatter(tree, leaf_triangles);
        assert!(
            greatest < triangle_count || tree.order().is_empty(),
            "the tree contains triangle {greatest}, the scene has only {triangle_count}"
        );
        pack(&self.leaf_children, bits);
        rank(bits, ranks);
        Topology::of_words(words)
    }

    /// Converts `tree` to a record and, in parallel, to [`Topology::treelets`]. Parameters and panics are those of
    /// [`Converter::convert`]. Uses 5 bytes of scratch memory per triangle, and 4 more for trees with a wide form.
    #[must_use]
    pub fn convert_with_treelets(
        &mut self,
        tree: &BinaryTree,
        triangle_count: usize,
        reuse: Spare,
    ) -> Topology {
        let mut workspace = std::mem::take(&mut self.workspace);
        let (words, treelets) = (reuse.words, Vec::new());
        let record_spare = Spare { words, treelets };
        let (mut record, treelets) = rayon::join(
            || self.convert(tree, triangle_count, record_spare),
            || Treelets::of_tree_in(tree, &mut workspace, reuse.treelets),
        );
        self.workspace = workspace;
        record.treelets = Some(Box::new(treelets));
        record
    }

    /// Counts the nodes that each chunk adds to each level.
    fn count(&mut self, tree: &BinaryTree) {
        let chunks = tree.left_leaves().par_chunks(CHUNK).enumerate();
        chunks
            .map(|(chunk, left_leaves)| {
                let mut tally = LevelCounts {
                    inner: [0; DEPTHS],
                    leaves: [0; DEPTHS],
                };
                Walk::starting_at(tree, chunk * CHUNK).run(left_leaves, |node| {
                    tally.inner[node.depth as usize] += 1;
                    tally.leaves[node.depth as usize] += node.leaf_children.count_ones();
                });
                tally
            })
            .collect_into_vec(&mut self.tallies);
    }

    /// Returns the level table. Each level from the root on has inner nodes, except the last, which has only leaves.
    fn inner_per_level(&self, tree: &BinaryTree) -> Vec<u32> {
        if tree.order().is_empty() {
            return Vec::new();
        }
        let total = |depth| self.tallies.iter().map(|t| t.inner[depth]).sum::<u32>();
        let mut inner: Vec<u32> = (0..DEPTHS).map(total).take_while(|&k| k > 0).collect();
        inner.push(0);
        inner
    }

    /// Appends every node to its level. Returns the largest triangle index in the tree.
    fn scatter(&mut self, tree: &BinaryTree, leaf_triangles: &mut [u32]) -> usize {
        self.leaf_children.resize(tree.left_leaves().len(), 0);
        if let [root] = tree.order() {
            leaf_triangles[0] = *root;
            return *root as usize;
        }
        let leaves = segments(leaf_triangles, &self.tallies, |t| &t.leaves);
        let inner = segments(&mut self.leaf_children, &self.tallies, |t| &t.inner);
        let chunks = tree.left_leaves().par_chunks(CHUNK).enumerate();
        chunks
            .zip(leaves.into_par_iter().zip(inner))
            .map(|((chunk, left_leaves), (leaves, inner))| {
                let walk = Walk::starting_at(tree, chunk * CHUNK);
                scatter_chunk(walk, left_leaves, tree.order(), leaves, inner)
            })
            .max()
            .unwrap_or(0) as usize
    }
}

/// Splits `array` into one part per level and chunk, levels outermost, with the lengths that `lengths` returns.
/// Returns each chunk's parts by level.
fn segments<'a, T>(
    mut array: &'a mut [T],
    chunks: &[LevelCounts],
    lengths: fn(&LevelCounts) -> &[u32; DEPTHS],
) -> Vec<[&'a mut [T]; DEPTHS]> {
    let empty = || std::array::from_fn(|_| <&mut [T]>::default());
    let mut parts: Vec<_> = chunks.iter().map(|_| empty()).collect();
    for level in 0..DEPTHS {
        for (chunk, parts) in chunks.iter().zip(&mut parts) {
            let length = lengths(chunk)[level] as usize;
            (parts[level], array) = array.split_at_mut(length);
        }
    }
    parts
}

/// Appends one chunk's nodes to the chunk's parts of the levels. Returns the largest triangle index in the chunk.
fn scatter_chunk(
    walk: Walk,
    left_leaves: &[u32],
    order: &[u32],
    mut leaves: [&mut [u32]; DEPTHS],
    mut inner: [&mut [u8]; DEPTHS],
) -> u32 {
    let mut leaf_ends = [0_usize; DEPTHS];
    let mut inner_ends = [0_usize; DEPTHS];
    let mut greatest = 0;
    walk.run(left_leaves, |node| {
        let depth = node.depth as usize;
        let flags = node.leaf_children;
        inner[depth][inner_ends[depth]] = flags;
        inner_ends[depth] += 1;
        // Writes a triangle for inner children too, which avoids a branch. The next leaf overwrites it. If no leaf
        // follows, `get_mut` returns `None`.
        let end = &mut leaf_ends[depth];
        for (child, is_leaf) in [(node.left, flags & 1), (node.right, flags >> 1)] {
            let triangle = order[child as usize];
            greatest = triangle.max(greatest);
            if let Some(slot) = leaves[depth].get_mut(*end) {
                *slot = triangle;
            }
            *end += usize::from(is_leaf);
        }
    });
    greatest
}

/// Number of words that one task of [`pack`] writes.
const PACKED: usize = 1 << 12;

/// Packs two bits per inner node, shifted by one bit, since the children of node `k` are nodes `2k + 1` and `2k + 2`.
/// Bit 0 is the root's: 1 if it is the only node.
fn pack(leaf_children: &[u8], bits: &mut [u32]) {
    let tasks = bits.par_chunks_mut(PACKED).enumerate();
    tasks.for_each(|(task, bits)| {
        let first = task * PACKED * 16;
        let mut carry = match first.checked_sub(1) {
            Some(before) => u32::from(leaf_children[before] >> 1),
            None => u32::from(leaf_children.is_empty()),
        };
        let mut nodes = leaf_children[first..].chunks(16);
        for word in bits {
            let pairs = nodes.next().map_or(0, pairs);
            *word = pairs << 1 | carry;
            carry = pairs >> 31;
        }
    });
}

/// Packs the lowest two bits of up to 16 bytes, the first byte in the lowest bits.
fn pairs(bytes: &[u8]) -> u32 {
    let join = |pairs, (i, &byte): (usize, &u8)| pairs | u32::from(byte) << (2 * i);
    bytes.iter().enumerate().fold(0, join)
}

/// Writes, for each word, the number of ones in the words before it.
fn rank(bits: &[u32], ranks: &mut [u32]) {
    let mut before = 0;
    for (word, rank) in bits.iter().zip(ranks) {
        *rank = before;
        before += word.count_ones();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{check_against, random_tree, record, scene, shapes};

    #[test]
    fn conversion_preserves_the_tree() {
        let large = random_tree(5 * CHUNK + 17, 3);
        for tree in shapes().into_iter().chain([large]) {
            check_against(&record(&tree), &tree);
        }
    }

    #[test]
    fn reused_memory_does_not_change_results() {
        let mut converter = Converter::default();
        let [mut plain, mut spare] = [(); 2].map(|()| Spare::default());
        plain.words = vec![u32::MAX; 5_000];
        let (up, down) = (shapes().into_iter(), shapes().into_iter().rev());
        for tree in up.chain(down) {
            let fresh = record(&tree);
            let reused = converter.convert(&tree, scene(&tree), plain);
            assert_eq!(reused, fresh);
            plain = reused.into_spare();
            plain.words.fill(u32::MAX);
            let both = converter.convert_with_treelets(&tree, scene(&tree), spare);
            assert_eq!(both.words(), fresh.words());
            assert_eq!(both.treelets(), Some(&Treelets::of(&fresh)));
            spare = both.into_spare();
            spare.words.fill(u32::MAX);
            spare.treelets.fill(u32::MAX);
            converter.workspace.inner.fill(u32::MAX);
            let places = converter.workspace.places.iter_mut();
            places.for_each(|place| *place.get_mut() = u32::MAX);
        }
    }

    #[test]
    fn accepts_triangles_without_leaves() {
        let record = Converter::default().convert(&BinaryTree::default(), 3, Spare::default());
        assert_eq!((record.triangle_count(), record.leaf_count()), (3, 0));
    }

    #[test]
    #[should_panic(expected = "contains triangle")]
    fn panics_on_trees_of_other_scenes() {
        let tree = random_tree(100, 1);
        let greatest = *tree.order().iter().max().unwrap();
        let _ = Converter::default().convert(&tree, greatest as usize, Spare::default());
    }

    #[test]
    #[should_panic(expected = "deeper than MAX_DEPTH")]
    fn panics_on_too_deep_trees() {
        let order: Vec<u32> = (0..300).collect();
        let left_leaves: Vec<u32> = (0..299).map(|i| 299 - i).collect();
        let tree = BinaryTree::new(order, left_leaves);
        let _ = Converter::default().convert(&tree, 300, Spare::default());
    }
}
