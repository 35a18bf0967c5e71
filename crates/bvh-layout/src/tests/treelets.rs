//! Treelets read back, node by node.

use super::{chain, random_tree, record, shapes};
use crate::{Treelet, Treelets};
use bvh_build::BinaryTree;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};

/// A reading of treelets that knows the layout's description alone; keeps the triangles of each row of a box, if told to.
struct Reader<'a>(&'a Treelets, Option<RefCell<HashMap<u32, Vec<u32>>>>);

/// The triangles below each row of a box, depth first.
pub(crate) fn triangles_of_rows(treelets: &Treelets) -> HashMap<u32, Vec<u32>> {
    let reader = Reader(treelets, Some(RefCell::default()));
    let (all, _) = reader.tree();
    let mut rows = reader.1.unwrap().into_inner();
    rows.insert(0, all.order);
    rows
}

/// What a node stands for: its triangles, depth first, and the leaves to the left of each of its inner nodes.
#[derive(Clone, Debug, Default, PartialEq)]
struct Found {
    order: Vec<u32>,
    left_leaves: Vec<u32>,
}

impl Found {
    fn over(left: Self, right: Self) -> Self {
        let mut left_leaves = vec![left.order.len() as u32];
        left_leaves.extend(left.left_leaves);
        left_leaves.extend(right.left_leaves);
        let order = [left.order, right.order].concat();
        Self { order, left_leaves }
    }
}

impl Reader<'_> {
    /// Reads the whole tree, each root from its row; also what lies below each.
    fn tree(&self) -> (Found, HashMap<u32, Found>) {
        let mut rows = HashMap::<u32, Found>::new();
        let mut inner_rows = BTreeSet::new();
        for (number, level) in (0..).zip(&self.0.levels) {
            for treelet in level.clone() {
                let entry = self.0.treelet(treelet as usize);
                let leaf = |i: u32| match number {
                    0 => self.triangles(entry.first_leaf + i),
                    _ => rows[&(entry.first_leaf + 2 * i)].clone(),
                };
                let found: Vec<Found> = (0..entry.root_count)
                    .map(|root| self.node(entry, self.word(entry.roots_at + root), &leaf).0)
                    .collect();
                for i in 0..entry.inner_count {
                    assert!(inner_rows.insert(entry.inner_row + 4 * i), "a row twice");
                }
                for (root, found) in (0..).zip(found) {
                    let row = entry.root_row + 2 * root;
                    assert!(row == 0 || row + 2 <= self.0.rows() as u32);
                    assert!(rows.insert(row, found).is_none(), "root row {row} twice");
                }
            }
        }
        let all = (1..=self.0.inner_count).map(|i| 4 * i);
        assert!(inner_rows.into_iter().eq(all));
        (rows.get(&0).cloned().unwrap_or_default(), rows)
    }

    fn node(&self, entry: Treelet, reference: u32, leaf: &dyn Fn(u32) -> Found) -> (Found, u32) {
        assert!(reference < 512);
        let number = reference & 255;
        if reference & 256 != 0 {
            assert!(number < entry.leaf_count);
            return (leaf(number), 0);
        }
        assert!(number < entry.inner_count);
        let words = (0..entry.inner_count).map(|i| self.word(entry.inner_at + i));
        let word = words.clone().find(|word| word >> 18 & 255 == number);
        let word = word.expect("every inner node has a word");
        assert!(words.is_sorted_by_key(|word| word >> 26));
        let (left, left_height) = self.node(entry, word & 511, leaf);
        let (right, right_height) = self.node(entry, word >> 9 & 511, leaf);
        let height = 1 + left_height.max(right_height);
        assert_eq!((word >> 26) + 1, height);
        assert!(height <= entry.height);
        if let Some(rows) = &self.1 {
            let row = entry.inner_row + 4 * number;
            let both = [(row, left.order.clone()), (row + 2, right.order.clone())];
            rows.borrow_mut().extend(both);
        }
        (Found::over(left, right), height)
    }

    fn triangles(&self, leaf: u32) -> Found {
        let at = self.0.triangles_at() as u32 + leaf;
        let word = self.word(at);
        let one = |word| Found {
            order: vec![word],
            ..Found::default()
        };
        match word & Treelets::SHARED {
            0 => one(word),
            _ => Found::over(one(word & !Treelets::SHARED), one(self.word(at + 1))),
        }
    }

    fn word(&self, at: u32) -> u32 {
        self.0.words()[at as usize]
    }
}

fn check(tree: &BinaryTree) -> Treelets {
    let treelets = Treelets::of_tree(tree);
    let (found, rows) = Reader(&treelets, None).tree();
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
    each_treelet_stands_below_one(&treelets);
    let record = record(tree);
    assert_eq!(Treelets::of(&record), treelets);
    treelets
}

/// The rows that a treelet's leaves stand on are all roots of its children and no others.
fn each_treelet_stands_below_one(treelets: &Treelets) {
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
fn treelets_are_the_tree() {
    for tree in shapes() {
        check(&tree);
    }
}

#[test]
fn large_trees_take_several_levels_and_are_the_tree_still() {
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
fn a_triangle_takes_at_most_8_bytes_and_treelets_are_mostly_full() {
    for (leaves, least) in [(100_000, 0.5), (150_000, 0.85)] {
        let treelets = check(&random_tree(leaves, 4));
        let bytes = treelets.bytes() as f64 / leaves as f64;
        assert!(bytes < 8.0, "{bytes}");
        let full = leaves as f64 / (Treelets::LEAVES * treelets.levels[0].len()) as f64;
        assert!(full > least, "{full}");
    }
}
