//! Tests of treelets, read back node by node.

use super::{chain, random_tree};
use crate::{Treelet, Treelets};
use bvh_build::BinaryTree;
use std::collections::BTreeMap;

/// Decodes treelets by the layout's documentation alone, and stores the subtree of each box's row.
struct Reader<'a> {
    treelets: &'a Treelets,
    rows: BTreeMap<u32, Found>,
}

/// Returns the subtree of each box, by the first row of the box.
pub(crate) fn rows_of(treelets: &Treelets) -> BTreeMap<u32, Found> {
    let rows = BTreeMap::new();
    let mut reader = Reader { treelets, rows };
    for (level, numbers) in treelets.levels.iter().enumerate() {
        for number in numbers.clone() {
            let entry = treelets.treelet(number as usize);
            for root in 0..entry.root_count {
                let reference = reader.word(entry.roots_at + root);
                let (found, _) = reader.node((level == 0, entry), reference);
                reader.keep(entry.root_row + 2 * root, found);
            }
        }
    }
    let root = (treelets.leaf_count > 0).then_some(0);
    let others = (4..treelets.rows() as u32).step_by(2);
    assert!(
        reader
            .rows
            .keys()
            .copied()
            .eq(root.into_iter().chain(others))
    );
    reader.rows
}

/// A decoded subtree: its triangles, depth first, and the number of leaves of each inner node's left child, in preorder.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Found {
    pub(crate) order: Vec<u32>,
    left_leaves: Vec<u32>,
}

impl Found {
    fn over(left: &Self, right: &Self) -> Self {
        let first = [left.order.len() as u32];
        Self {
            left_leaves: [&first[..], &left.left_leaves, &right.left_leaves].concat(),
            order: [&left.order[..], &right.order].concat(),
        }
    }
}

impl Reader<'_> {
    fn keep(&mut self, row: u32, found: Found) {
        assert!(self.rows.insert(row, found).is_none(), "row {row} twice");
    }

    /// Decodes a node of a treelet. Returns its subtree and height. `of.0` is true on the lowest level.
    fn node(&mut self, of: (bool, Treelet), reference: u32) -> (Found, u32) {
        assert!(reference < 512);
        let ((is_lowest, entry), number) = (of, reference & 255);
        if reference & 256 != 0 {
            assert!(number < entry.leaf_count);
            let found = match is_lowest {
                true => self.triangles(entry.first_leaf + number),
                false => self.rows[&(entry.first_leaf + 2 * number)].clone(),
            };
            return (found, 0);
        }
        assert!(number < entry.inner_count);
        let mut words = (0..entry.inner_count).map(|i| self.word(entry.inner_at + i));
        assert!(words.clone().is_sorted_by_key(|word| word >> 26));
        let word = words.find(|word| word >> 18 & 255 == number);
        let word = word.expect("every inner node has a word");
        let (left, left_height) = self.node(of, word & 511);
        let (right, right_height) = self.node(of, word >> 9 & 511);
        let height = 1 + left_height.max(right_height);
        assert_eq!((word >> 26) + 1, height);
        assert!(height <= entry.height);
        let (row, found) = (entry.inner_row + 4 * number, Found::over(&left, &right));
        self.keep(row, left);
        self.keep(row + 2, right);
        (found, height)
    }

    fn triangles(&self, leaf: u32) -> Found {
        let at = self.treelets.triangles_at() as u32 + leaf;
        let one = |word| Found {
            order: vec![word],
            ..Found::default()
        };
        let word = self.word(at);
        match word & Treelets::SHARED {
            0 => one(word),
            _ => Found::over(&one(word & !Treelets::SHARED), &one(self.word(at + 1))),
        }
    }

    fn word(&self, at: u32) -> u32 {
        self.treelets.words()[at as usize]
    }
}

pub(super) fn check(tree: &BinaryTree) -> Treelets {
    let treelets = Treelets::of(tree);
    let rows = rows_of(&treelets);
    let found = rows.get(&0).cloned().unwrap_or_default();
    assert_eq!(found.order, tree.order());
    for most in [1, 3, 40, 2_000, u32::MAX] {
        let (first, count) = treelets.few_roots(most);
        if tree.order().is_empty() {
            break;
        }
        let below = (0..count).map(|i| &rows[&(first + 2 * i)].order);
        let all = below.flatten().copied().collect::<Vec<_>>();
        assert!(count <= most && all == tree.order(), "{count} of {most}");
    }
    assert_eq!(found.left_leaves, tree.left_leaves());
    for number in 0..treelets.treelet_count() {
        let entry = treelets.treelet(number);
        assert!((1..=Treelets::LEAVES as u32).contains(&entry.leaf_count));
        assert!(entry.inner_count < entry.leaf_count);
    }
    check_parents(&treelets);
    treelets
}

/// Checks that a treelet's leaves have exactly the rows of its children's roots, and that one treelet has no parent.
fn check_parents(treelets: &Treelets) {
    let all = (0..treelets.treelet_count() as u32).map(|t| (t, treelets.treelet(t as usize)));
    let levels = &treelets.levels;
    for (number, parent) in all.clone().skip(levels.first().map_or(0, |l| l.len())) {
        let children = all.clone().filter(|(_, child)| child.parent == number);
        let rows_of = |(_, c): (u32, Treelet)| (0..c.root_count).map(move |r| c.root_row + 2 * r);
        let below = (0..parent.leaf_count).map(|i| parent.first_leaf + 2 * i);
        assert!(
            children.clone().flat_map(rows_of).eq(below),
            "treelet {number}"
        );
        assert_eq!(parent.children as usize, children.count());
    }
    let orphans = all.filter(|(_, t)| t.parent == Treelet::NONE).count();
    assert_eq!(orphans, usize::from(treelets.treelet_count() > 0));
}

#[test]
fn large_trees_use_several_treelet_levels() {
    for (leaves, levels) in [(257, 2), (20_000, 2), (150_000, 3)] {
        let treelets = check(&random_tree(leaves, 9));
        assert_eq!(treelets.levels.len(), levels, "{leaves} leaves");
        let (least, most) = (treelets.few_roots(1), treelets.few_roots(u32::MAX));
        assert!(least == (0, 1) && most.1 > leaves as u32 / 256, "{most:?}");
    }
    for leaves in [40_000, 140_000] {
        let deepest = check(&chain(leaves));
        assert!(deepest.levels.len() > 2);
    }
}

#[test]
fn treelets_are_compact_and_mostly_full() {
    for (leaves, least) in [(100_000, 0.5), (150_000, 0.85)] {
        let treelets = check(&random_tree(leaves, 4));
        let bytes = treelets.bytes() as f64 / leaves as f64;
        assert!(bytes < 8.0, "{bytes}");
        let full = leaves as f64 / (Treelets::LEAVES * treelets.levels[0].len()) as f64;
        assert!(full > least, "{full}");
    }
}
