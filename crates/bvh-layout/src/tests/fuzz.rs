//! Damaged records against a second reading of the layout that shares no code with the first.

use super::{chain, random_tree, record as record_of};
use crate::Topology;
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Decides by rebuilding the record from its bits and triangles alone.
fn is_valid(words: &[u32]) -> bool {
    rebuild(words).is_some_and(|rebuilt| rebuilt == words)
}

/// The record that has the same scene size, leaf bits and triangles; `None` if no tree has them.
fn rebuild(words: &[u32]) -> Option<Vec<u32>> {
    let &[_, _, scene, n, level_count, ..] = words else {
        return None;
    };
    let nodes = (2 * u64::from(n)).saturating_sub(1);
    let bit_words = nodes.div_ceil(32);
    let first_bit_word = 8 + u64::from(level_count);
    if words.len() as u64 != first_bit_word + 2 * bit_words + u64::from(n) || scene > 1 << 30 {
        return None;
    }
    let bits = &words[first_bit_word as usize..][..bit_words as usize];
    let mut depths = if n > 0 { vec![0] } else { vec![] };
    let (mut table, mut ranks, mut leaves) = (Vec::new(), Vec::new(), 0);
    let mut clean_bits = vec![0_u32; bit_words as usize];
    for node in 0..nodes as usize {
        if node % 32 == 0 {
            ranks.push(leaves);
        }
        let depth: usize = *depths.get(node)?;
        table.resize(depth + 1, 0);
        if bits[node / 32] & (1 << (node % 32)) != 0 {
            clean_bits[node / 32] |= 1 << (node % 32);
            leaves += 1;
        } else {
            table[depth] += 1;
            depths.extend([depth + 1, depth + 1]);
        }
    }
    let triangles = &words[words.len() - n as usize..];
    let distinct: BTreeSet<u32> = triangles.iter().copied().filter(|&t| t < scene).collect();
    if depths.len() as u64 != nodes || table.len() > 65 || distinct.len() != n as usize {
        return None;
    }
    let header = [0x4856_4241, 1, scene, n, table.len() as u32, 0, 0, 0];
    Some([&header[..], &table, &clean_bits, &ranks, triangles].concat())
}

fn record() -> impl Strategy<Value = Vec<u32>> {
    let tree = (0..200_usize, any::<u64>(), any::<bool>()).prop_map(|(n, seed, deep)| {
        if deep { chain(n) } else { random_tree(n, seed) }
    });
    tree.prop_map(|tree| record_of(&tree).words().to_vec())
}

/// Damages some word, or the length.
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
    fn a_damaged_record_is_taken_only_if_it_is_a_record(
        mut words in record(),
        damages in prop::collection::vec((0..7_u8, any::<prop::sample::Index>(), any::<u32>()), 0..3),
    ) {
        damages.into_iter().for_each(|d| damage(&mut words, d));
        let expected = is_valid(&words);
        let found = Topology::from_words(words);
        prop_assert_eq!(found.is_ok(), expected, "{:?}", found);
    }

    #[test]
    fn words_at_random_never_panic(mut words in prop::collection::vec(any::<u32>(), 0..40), small: bool) {
        if small {
            for (word, given) in words.iter_mut().zip([Topology::MAGIC, 1, 9, 5]) {
                *word = given;
            }
            words.iter_mut().skip(4).for_each(|word| *word %= 8);
        }
        prop_assert_eq!(Topology::from_words(words.clone()).is_ok(), is_valid(&words));
    }
}

/// Each property has its error, which says where and what. Each line: a word, what it becomes, and the error.
#[test]
fn what_is_wrong_is_named() {
    let sample = record_of(&random_tree(40, 11));
    let (levels, words) = (sample.level_count(), sample.words());
    let (bits, last, length) = (8 + levels, levels - 1, words.len());
    let (end, more, ranks, leaf) = (bits + 2, 7 + last, bits + 4, bits + 13);
    let (past, deep, inner) = (words[end] | 1 << 31, words[more], words[more] + 1);
    let (ones, root) = (words[bits].count_ones(), words[bits] | 1);
    let (rank, twice, triangles) = (
        ones + 1,
        sample.leaf_triangles()[2],
        sample.triangle_count(),
    );
    let shorter = length - 1;
    let changes = format!(
        "0 | 5 | word 0 is 0x00000005, a record begins with 0x48564241
        1 | 2 | word 1 gives layout version 2, only 1 is known
        6 | 9 | words 5 to 7 are [0, 9, 0], they are reserved and must be 0
        2 | 4294967295 | word 2 gives 4294967295 triangles, the limit is 1073741824
        2 | 39 | word 3 gives 40 leaves, the scene has 39 triangles
        4 | 66 | word 4 gives 66 levels, the limit is 65
        3 | 39 | the record has {length} words, its header asks for {shorter}
        4 | 0 | the record has {length} words, its header asks for {}
        8 | 2 | level 0 has 2 inner nodes, its bits have 1
        {more} | {inner} | level {} has {inner} inner nodes, its bits have {deep}
        {bits} | {root} | level 0 has 1 inner nodes, its bits have 0
        {end} | {past} | bits past the last node 78 must be 0, they are 0x10000
        {ranks} | {rank} | {rank} leaves are counted before node 32, there are {ones}
        {leaf} | 500 | leaf 7 names triangle 500, the scene has {triangles}
        {leaf} | {twice} | leaves 2 and 7 both name triangle {twice}",
        length - levels,
        last - 1
    );
    for change in changes.lines() {
        let parts: Vec<_> = change.trim().split(" | ").collect();
        let mut words = words.to_vec();
        words[parts[0].parse::<usize>().unwrap()] = parts[1].parse().unwrap();
        let error = Topology::from_words(words).unwrap_err();
        assert_eq!(error.to_string(), parts[2]);
    }
}

#[test]
fn levels_end_where_nodes_do() {
    for (levels, bits, says) in [
        (&[1, 0, 0][..], 6, "level 2 has 0 nodes, 0 are left"),
        (&[1, 2], 0, "2 levels have 3 nodes, 2 leaves make 3"),
        (&[], 6, "0 levels have 0 nodes, 2 leaves make 3"),
    ] {
        let header = [Topology::MAGIC, 1, 2, 2, levels.len() as u32, 0, 0, 0];
        let words = [&header, levels, &[bits, 0], &[0, 1]].concat();
        let error = Topology::from_words(words).unwrap_err();
        assert_eq!(error.to_string(), says);
    }
}
