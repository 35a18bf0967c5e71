//! From cuts to words: each treelet by itself, in parallel.

use super::cut::{Cut, children};
use super::{CHILDREN, PARENT, Treelet, Treelets};
use crate::walk::Shape;
use bvh_build::Subtree;
use rayon::prelude::*;

/// Bit 8 of a reference: a leaf.
const LEAF: u32 = 1 << 8;

/// A treelet on its way: what it is made of, and its own part of the words.
struct Task<'a> {
    left_leaves: &'a [u32],
    roots: &'a [Subtree],
    root_words: &'a mut [u32],
    /// Its triangles; empty on higher levels, where no two leaves are joined.
    triangles: &'a mut [u32],
    order: &'a [u32],
    /// Room for as many inner nodes as it has leaves.
    inner: &'a mut [u32],
}

pub(super) fn fill(shape: Shape<'_>, cuts: &[Cut]) -> Treelets {
    let count = |of: fn(&Cut) -> usize| cuts.iter().map(of).sum::<usize>();
    let (treelets, roots) = (count(|c| c.treelets.len()), count(|c| c.roots.len()));
    let leaves = shape.order.len();
    let room = count(|c| c.roots.iter().map(|r| r.leaves as usize).sum());
    let inner_at = treelets * Treelets::ENTRY_WORDS + roots + leaves;
    let mut words = vec![0; inner_at + room];
    let found: Vec<(u32, u32)> = {
        let body = &mut words[treelets * Treelets::ENTRY_WORDS..];
        let tasks = tasks(shape, cuts, body, roots);
        tasks.into_par_iter().map(Task::run).collect()
    };
    let inner_count: u32 = found.iter().map(|&(inner, _)| inner).sum();
    let mut made = Treelets {
        words,
        levels: Vec::new(),
        leaf_count: leaves as u32,
        inner_count,
        root_count: roots as u32,
        moving: None,
    };
    made.finish(cuts, &found, inner_at);
    made
}

/// Cuts the words after the table into every treelet's own parts.
fn tasks<'a>(
    shape: Shape<'a>,
    cuts: &'a [Cut],
    body: &'a mut [u32],
    roots: usize,
) -> Vec<Task<'a>> {
    let (mut root_words, body) = body.split_at_mut(roots);
    let (mut triangles, mut inner) = body.split_at_mut(shape.order.len());
    let mut left_leaves = shape.left_leaves;
    let mut tasks = Vec::new();
    for cut in cuts {
        for treelet in &cut.treelets {
            let leaves = cut.leaves(treelet);
            let own = leaves.len().min(triangles.len());
            tasks.push(Task {
                left_leaves,
                roots: &cut.roots[treelet.clone()],
                root_words: take(&mut root_words, treelet.len()),
                triangles: take(&mut triangles, own),
                order: shape.order.get(leaves.clone()).unwrap_or_default(),
                inner: take(&mut inner, leaves.len()),
            });
        }
        left_leaves = &cut.above;
    }
    tasks
}

fn take<'a>(from: &mut &'a mut [u32], count: usize) -> &'a mut [u32] {
    let (part, rest) = std::mem::take(from).split_at_mut(count);
    *from = rest;
    part
}

impl Task<'_> {
    /// Returns how many inner nodes it has and its height. Their words are sorted: those of a height are neighbours.
    fn run(mut self) -> (u32, u32) {
        let own = self.triangles.len();
        self.triangles.copy_from_slice(&self.order[..own]);
        let (mut inner, mut height) = (0, 0);
        for (i, &root) in self.roots.iter().enumerate() {
            let (reference, its_height) = self.enter(root, &mut inner);
            self.root_words[i] = reference;
            height = its_height.max(height);
        }
        self.inner[..inner as usize].sort_unstable_by_key(|word| word >> 18);
        (inner, height)
    }

    /// Writes a subtree; returns its reference and height. Trees are at most 64 levels deep.
    fn enter(&mut self, node: Subtree, inner: &mut u32) -> (u32, u32) {
        let leaf = node.first_leaf - self.roots[0].first_leaf;
        let shared = node.leaves == 2 && !self.triangles.is_empty();
        if shared {
            self.triangles[leaf as usize] |= Treelets::SHARED;
        }
        if shared || node.leaves == 1 {
            return (LEAF | leaf, 0);
        }
        let own = *inner;
        *inner += 1;
        let [left, right] = children(self.left_leaves, node);
        let (left, left_height) = self.enter(left, inner);
        let (right, right_height) = self.enter(right, inner);
        let height = 1 + left_height.max(right_height);
        self.inner[own as usize] = left | right << 9 | own << 18 | (height - 1) << 26;
        (own, height)
    }
}

impl Treelets {
    /// Closes the gaps between the treelets' inner nodes, and writes the table.
    fn finish(&mut self, cuts: &[Cut], found: &[(u32, u32)], inner_at: usize) {
        let mut next = Treelet {
            inner_at: inner_at as u32,
            inner_row: 4,
            roots_at: (found.len() * Self::ENTRY_WORDS) as u32,
            root_row: 4 * (1 + self.inner_count),
            parent: Treelet::NONE,
            ..Treelet::default()
        };
        let (mut number, mut room_at, mut rows_below) = (0, inner_at, None);
        for cut in cuts {
            let first = number;
            let rows_here = next.root_row;
            for treelet in &cut.treelets {
                let leaves = cut.leaves(treelet);
                let (inner_count, height) = found[number];
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
                    height,
                    ..next
                };
                self.write(number, entry, room_at);
                room_at += leaves.len();
                number += 1;
                next.inner_at += inner_count;
                next.inner_row += 4 * inner_count;
                next.roots_at += entry.root_count;
                next.root_row += 2 * entry.root_count;
            }
            self.levels.push(first as u32..number as u32);
            rows_below = Some(rows_here);
        }
        self.name_parents();
        self.words.truncate(inner_at + self.inner_count());
    }

    /// The treelets of a level stand, in order, on the roots of those of the level below.
    fn name_parents(&mut self) {
        let levels = self.levels.clone();
        for pair in levels.windows(2) {
            let mut below = pair[0].clone().peekable();
            for parent in pair[1].clone() {
                let mut left = self.treelet(parent as usize).leaf_count;
                while let Some(child) = below.next_if(|_| left > 0) {
                    left -= self.treelet(child as usize).root_count;
                    *self.entry_word(child, PARENT) = parent;
                    *self.entry_word(parent, CHILDREN) += 1;
                }
            }
        }
    }

    fn write(&mut self, number: usize, entry: Treelet, room_at: usize) {
        let inner = room_at..room_at + entry.inner_count as usize;
        self.words.copy_within(inner, entry.inner_at as usize);
        let at = number * Self::ENTRY_WORDS;
        self.words[at..][..Self::ENTRY_WORDS].copy_from_slice(&entry.words());
    }
}
