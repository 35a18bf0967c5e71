//! Damaged records are accepted only if they are valid.

use super::{chain, random_tree, record as record_of};
use crate::treelets::depth_first;
use crate::{Converter, Spare, Topology};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Checks that accepted words equal the converter's record of their tree. The converter shares no code with validation.
fn check_taken(words: Vec<u32>) -> Result<bool, TestCaseError> {
    let Ok(record) = Topology::from_words(words) else {
        return Ok(false);
    };
    let triangles: BTreeSet<_> = record.leaf_triangles().iter().collect();
    prop_assert_eq!(triangles.len(), record.leaf_count());
    let (tree, scene) = (depth_first(&record), record.triangle_count());
    let again = Converter::default().convert(&tree, scene, Spare::default());
    prop_assert_eq!(again.words(), record.words());
    Ok(true)
}

fn record() -> impl Strategy<Value = Vec<u32>> {
    let tree = (0..200_usize, any::<u64>(), any::<bool>()).prop_map(|(n, seed, deep)| {
        if deep { chain(n) } else { random_tree(n, seed) }
    });
    tree.prop_map(|tree| record_of(&tree).words().to_vec())
}

/// Damages one word, or the length.
fn damage(words: &mut Vec<u32>, (kind, at, value): (u8, prop::sample::Index, u32)) {
    if words.is_empty() {
        return;
    }
    let (at, length) = (at.index(words.len()), words.len());
    match kind {
        0 => words[at] ^= 1 << (value % 32),
        1 => words[at] ^= 1 << (value % 32) ^ 1 << (value / 32 % 32),
        2 => words[at] = value,
        3 => words[at] = words[at].wrapping_add(value % 7).wrapping_sub(3),
        4 => words.swap(at, value as usize % length),
        5 => words.truncate(at),
        _ => words.push(value),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn accepts_only_valid_topologies(
        mut words in record(),
        damages in prop::collection::vec((0..7_u8, any::<prop::sample::Index>(), any::<u32>()), 0..3),
    ) {
        let is_whole = damages.is_empty();
        damages.into_iter().for_each(|d| damage(&mut words, d));
        prop_assert!(check_taken(words)? || !is_whole);
    }

    #[test]
    fn random_words_never_panic(mut words in prop::collection::vec(any::<u32>(), 0..40), small: bool) {
        if small {
            for (word, given) in words.iter_mut().zip([Topology::MAGIC, 1, 9, 5]) {
                *word = given;
            }
            words.iter_mut().skip(4).for_each(|word| *word %= 8);
        }
        check_taken(words)?;
    }
}

/// Each line: index of a word, its new value, and the error.
#[test]
fn errors_name_the_invalid_word() {
    let sample = record_of(&random_tree(40, 11));
    let (levels, length) = (sample.level_count(), sample.words().len());
    let (bits, leaf) = (8 + levels, length - 33);
    let (outside, twice) = (sample.triangle_count() as u32, sample.leaf_triangles()[2]);
    for (at, word, says) in [
        (0, 5, "word 0 is 0x5, expected 0x48564241"),
        (1, 2, "word 1 is 0x2, expected 0x1"),
        (6, 9, "word 6 is 0x9, expected 0x0"),
        (8, 2, "word 8 is 0x2, expected 0x1"),
        (2, u32::MAX, "the limit is 1073741824"),
        (3, 39, "by its header"),
        (4, u32::MAX, "by its header"),
        (bits, 1, "the leaf bits do not describe a tree of 79 nodes"),
        (leaf, outside, "a triangle index occurs in two leaves"),
        (leaf, twice, "a triangle index occurs in two leaves"),
    ] {
        let mut words = sample.words().to_vec();
        words[at] = word;
        let error = Topology::from_words(words).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn rejects_inconsistent_level_ends() {
    let deepest = [vec![1; 65], vec![0]].concat();
    let chain = [vec![0xaaaa_aaaa; 4], vec![6]].concat();
    for (leaves, levels, bits, says) in [
        (0, vec![7], vec![], "word 4 is 0x1, expected"),
        (2, vec![1, 0, 0], vec![6], "word 4 is 0x3, expected"),
        (
            2,
            vec![1, 2],
            vec![0],
            "the leaf bits do not describe a tree of 3 nodes",
        ),
        (66, deepest, chain, "at most 65 levels"),
    ] {
        let [magic, count] = [Topology::MAGIC, levels.len() as u32];
        let header = [magic, 1, leaves, leaves, count, 0, 0, 0];
        let (ranks, triangles) = (vec![0; bits.len()], (0..leaves).collect());
        let words = [header.to_vec(), levels, bits, ranks, triangles].concat();
        let error = Topology::from_words(words).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}
