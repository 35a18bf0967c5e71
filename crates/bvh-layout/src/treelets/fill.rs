//! Encodes treelets as words, each treelet independently, in parallel.

use super::cut::Cut;
use super::{Treelet, Treelets, WideTree};
use bvh_build::{BinaryTree, MAX_DEPTH, Subtree};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Bit 8 of a reference marks a leaf.
const LEAF: u32 = 1 << 8;
/// First bit of `height - 1` in an inner node's word.
const HEIGHT_AT: u32 = 26;

/// Place of each inner node of the tree: `treelet number << 8 | node number in the treelet`.
/// Nodes of at most [`WideTree::LANES`] triangles have no place, since blocks of the wide tree contain them.
pub(super) type Places = [AtomicU32];

/// The inputs of one treelet, and its part of the output.
struct Task<'a, 's> {
    number: u32,
    left_leaves: &'a [u32],
    /// Index in the whole tree of each inner node of the level; `None` on the lowest level, where the indices are
    /// equal.
    whole_tree_indices: Option<&'a [u32]>,
    places: &'a Places,
    roots: &'a [Subtree],
    root_words: &'a mut [u32],
    /// Output for triangles; empty on higher levels, where leaves are not paired.
    triangles: &'a mut [u32],
    order: &'a [u32],
    /// Output for inner nodes, with one word for each leaf of the treelet.
    inner: &'s mut [u32],
}

/// Encodes all treelets. Reuses the memory of `scratch` and `words`, whatever they contain. `places` has an entry for
/// every inner node, or is empty.
pub(super) fn fill(
    tree: &BinaryTree,
    cuts: &[Cut],
    scratch: &mut Vec<u32>,
    mut words: Vec<u32>,
    places: &Places,
) -> Treelets {
    let count = |of: fn(&Cut) -> usize| cuts.iter().map(of).sum::<usize>();
    let (treelets, roots) = (count(|c| c.treelets.len()), count(|c| c.roots.len()));
    let leaves = tree.order().len();
    scratch.resize(
        count(|c| c.roots.iter().map(|r| r.leaves as usize).sum()),
        0,
    );
    let inner_at = treelets * Treelets::ENTRY_WORDS + roots + leaves;
    // Every word is written below, so reused words are not cleared.
    words.reserve((inner_at + scratch.len()).saturating_sub(words.len()));
    words.resize(inner_at, 0);
    let body = &mut words[treelets * Treelets::ENTRY_WORDS..];
    let tasks = tasks(tree, cuts, body, scratch, places);
    let found: Vec<EncodedTreelet<'_>> = tasks.into_par_iter().map(Task::run).collect();
    let inner_count: usize = found.iter().map(|treelet| treelet.inner.len()).sum();
    words.resize(inner_at + inner_count, 0);
    let mut rest = &mut words[inner_at..];
    let mut copies = Vec::with_capacity(found.len());
    for EncodedTreelet { inner, .. } in &found {
        copies.push((take(&mut rest, inner.len()), *inner));
    }
    let each = copies.into_par_iter().with_min_len(64);
    each.for_each(|(to, from)| to.copy_from_slice(from));
    let mut made = Treelets {
        words,
        leaf_count: leaves as u32,
        inner_count: inner_count as u32,
        root_count: roots as u32,
        ..Treelets::default()
    };
    made.finish(cuts, &found, inner_at);
    made
}

/// Splits the outputs into one part per treelet. `body` holds the roots, then the triangles. `inner` has one word for
/// each leaf of each level.
fn tasks<'a, 's>(
    tree: &'a BinaryTree,
    cuts: &'a [Cut],
    body: &'a mut [u32],
    mut inner: &'s mut [u32],
    places: &'a Places,
) -> Vec<Task<'a, 's>> {
    let roots = body.len() - tree.order().len();
    let (mut root_words, mut triangles) = body.split_at_mut(roots);
    let (mut left_leaves, mut whole_tree_indices) = (tree.left_leaves(), None);
    let mut tasks = Vec::new();
    for cut in cuts {
        for treelet in &cut.treelets {
            let leaves = cut.leaves(treelet);
            // The lowest level takes all triangles, so none are left for the others.
            let own = leaves.len().min(triangles.len());
            tasks.push(Task {
                number: tasks.len() as u32,
                left_leaves,
                whole_tree_indices,
                places,
                roots: &cut.roots[treelet.clone()],
                root_words: take(&mut root_words, treelet.len()),
                triangles: take(&mut triangles, own),
                order: tree.order().get(leaves.clone()).unwrap_or_default(),
                inner: take(&mut inner, leaves.len()),
            });
        }
        (left_leaves, whole_tree_indices) = (&cut.above, Some(&cut.whole_tree_indices[..]));
    }
    tasks
}

fn take<'a>(from: &mut &'a mut [u32], count: usize) -> &'a mut [u32] {
    let part = from.split_off_mut(..count);
    part.expect("enough words for all tasks")
}

struct EncodedTreelet<'s> {
    /// Inner nodes, sorted by height.
    inner: &'s [u32],
    height: u32,
}

/// Inner nodes of a treelet in preorder.
struct TreeletNodes {
    words: [u32; Treelets::LEAVES],
    count: u32,
    /// Entry `i` is the number of inner nodes of height `i + 1`.
    of_height: [u32; MAX_DEPTH as usize],
}

impl<'s> Task<'_, 's> {
    /// Encodes the treelet.
    fn run(mut self) -> EncodedTreelet<'s> {
        let own = self.triangles.len();
        self.triangles.copy_from_slice(&self.order[..own]);
        let mut inner = TreeletNodes {
            words: [0; Treelets::LEAVES],
            count: 0,
            of_height: [0; MAX_DEPTH as usize],
        };
        let mut height = 0;
        for (i, &root) in self.roots.iter().enumerate() {
            let (reference, its_height) = self.encode(root, &mut inner);
            self.root_words[i] = reference;
            height = its_height.max(height);
        }
        let words = &mut self.inner[..inner.count as usize];
        inner.sort_into(words);
        EncodedTreelet {
            inner: words,
            height,
        }
    }

    /// Encodes a subtree. Returns its reference and height. The recursion is as deep as the tree: at most 64 levels.
    fn encode(&mut self, node: Subtree, inner: &mut TreeletNodes) -> (u32, u32) {
        let leaf = node.first_leaf - self.roots[0].first_leaf;
        let shared = node.leaves == 2 && !self.triangles.is_empty();
        if shared {
            self.triangles[leaf as usize] |= Treelets::SHARED;
        }
        if shared || node.leaves == 1 {
            return (LEAF | leaf, 0);
        }
        let own = inner.count;
        inner.count += 1;
        // Nodes of higher levels always have more triangles than a block.
        if self.whole_tree_indices.is_some() || node.leaves as usize > WideTree::LANES {
            let index = (self.whole_tree_indices)
                .map_or(node.inner, |indices| indices[node.inner as usize]);
            if let Some(place) = self.places.get(index as usize) {
                place.store(self.number << 8 | own, Ordering::Relaxed);
            }
        }
        let [left, right] = node.children(self.left_leaves);
        let (left, left_height) = self.encode(left, inner);
        let (right, right_height) = self.encode(right, inner);
        let below = left_height.max(right_height);
        inner.of_height[below as usize] += 1;
        inner.words[own as usize] = left | right << 9 | own << 18 | below << HEIGHT_AT;
        (own, 1 + below)
    }
}

impl TreeletNodes {
    /// Sorts the words by height, lowest first, and in preorder within a height.
    fn sort_into(&mut self, to: &mut [u32]) {
        let mut ends = self.of_height;
        let mut sum = 0;
        for end in &mut ends {
            sum += std::mem::replace(end, sum);
        }
        for &word in &self.words[..self.count as usize] {
            let end = &mut ends[(word >> HEIGHT_AT) as usize];
            to[*end as usize] = word;
            *end += 1;
        }
    }
}

impl Treelets {
    /// Writes the table of treelets and the ranges of all levels. Inner nodes begin at word `inner_at`.
    fn finish(&mut self, cuts: &[Cut], found: &[EncodedTreelet<'_>], inner_at: usize) {
        // Start of the next treelet's parts.
        let mut next = Treelet {
            inner_at: inner_at as u32,
            inner_row: 4,
            roots_at: (found.len() * Self::ENTRY_WORDS) as u32,
            root_row: 4 * (1 + self.inner_count),
            parent: Treelet::NONE,
            ..Treelet::default()
        };
        let (mut number, mut rows_below) = (0, None);
        for cut in cuts {
            let first = number;
            let rows_here = next.root_row;
            for treelet in &cut.treelets {
                let leaves = cut.leaves(treelet);
                let inner_count = found[number].inner.len() as u32;
                let entry = Treelet {
                    first_leaf: rows_below.map_or(leaves.start as u32, |row: u32| {
                        row + 2 * leaves.start as u32
                    }),
                    leaf_count: leaves.len() as u32,
                    inner_count,
                    root_count: treelet.len() as u32,
                    root_row: if cut.above.is_empty() {
                        0
                    } else {
                        next.root_row
                    },
                    height: found[number].height,
                    ..next
                };
                *self.entry_mut(number as u32) = entry;
                number += 1;
                next.inner_at += inner_count;
                next.inner_row += 4 * inner_count;
                next.roots_at += entry.root_count;
                next.root_row += 2 * entry.root_count;
            }
            self.levels.push(first as u32..number as u32);
            rows_below = Some(rows_here);
        }
        self.set_parents();
    }

    /// Sets each treelet's parent and number of children. The leaves of a level's treelets are, in order, the roots of
    /// the treelets below.
    fn set_parents(&mut self) {
        let levels = self.levels.clone();
        for pair in levels.windows(2) {
            let mut below = pair[0].clone().peekable();
            for parent in pair[1].clone() {
                let mut left = self.treelet(parent as usize).leaf_count;
                while let Some(child) = below.next_if(|_| left > 0) {
                    left -= self.treelet(child as usize).root_count;
                    self.entry_mut(child).parent = parent;
                    self.entry_mut(parent).children += 1;
                }
            }
        }
    }
}
