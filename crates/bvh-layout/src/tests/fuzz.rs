//! Damaged records against a second reading of the layout that shares no code with the first.

use super::{chain, random_tree, record as record_of};
use crate::{RecordError, Topology};
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
    tree.prop_map(|tree| {
        let record = record_of(&tree);
        record.into_words()
    })
}

#[derive(Clone, Debug)]
enum Damage {
    Flip(prop::sample::Index, u32),
    FlipTwo(prop::sample::Index, u32, u32),
    Set(prop::sample::Index, u32),
    Nudge(prop::sample::Index, i32),
    Swap(prop::sample::Index, prop::sample::Index),
    Truncate(prop::sample::Index),
    Extend(Vec<u32>),
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<prop::sample::Index>;
    prop_oneof![
        (at(), 0..32_u32).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        (at(), 0..32_u32, 0..32_u32).prop_map(|(at, a, b)| Damage::FlipTwo(at, a, b)),
        (at(), any::<u32>()).prop_map(|(at, word)| Damage::Set(at, word)),
        (at(), -3..=3).prop_map(|(at, by)| Damage::Nudge(at, by)),
        (at(), at()).prop_map(|(a, b)| Damage::Swap(a, b)),
        at().prop_map(Damage::Truncate),
        prop::collection::vec(any::<u32>(), 1..4).prop_map(Damage::Extend),
    ]
}

impl Damage {
    fn apply(&self, words: &mut Vec<u32>) {
        let len = words.len();
        match self {
            Self::Flip(at, bit) => words[at.index(len)] ^= 1 << bit,
            Self::FlipTwo(at, a, b) => words[at.index(len)] ^= 1 << a ^ 1 << b,
            Self::Set(at, word) => words[at.index(len)] = *word,
            Self::Nudge(at, by) => {
                let word = &mut words[at.index(len)];
                *word = word.wrapping_add_signed(*by);
            }
            Self::Swap(a, b) => words.swap(a.index(len), b.index(len)),
            Self::Truncate(at) => words.truncate(at.index(len)),
            Self::Extend(more) => words.extend(more),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn a_damaged_record_is_taken_only_if_it_is_a_record(
        mut words in record(),
        damages in prop::collection::vec(damage(), 0..3),
    ) {
        for damage in &damages {
            if !words.is_empty() {
                damage.apply(&mut words);
            }
        }
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

#[test]
fn any_one_bit_flipped_outside_triangles_and_scene_is_noticed() {
    let tree = random_tree(50, 9);
    let record = record_of(&tree);
    let tree_words = record.words().len() - record.leaf_count();
    for bit in (0..tree_words * 32).filter(|bit| bit / 32 != 2) {
        let mut words = record.words().to_vec();
        words[bit / 32] ^= 1 << (bit % 32);
        assert!(Topology::from_words(words).is_err(), "bit {bit}");
    }
}

/// A record of 40 leaves.
fn sample() -> Topology {
    let tree = random_tree(40, 11);
    record_of(&tree)
}

/// The error that the sample gives once `change` is made to its word `word`.
fn error_of(word: usize, change: impl Fn(u32) -> u32) -> RecordError {
    let mut words = sample().into_words();
    words[word] = change(words[word]);
    Topology::from_words(words).unwrap_err()
}

#[test]
fn each_property_of_the_header_has_its_error() {
    use RecordError as E;
    assert_eq!(error_of(0, |_| 5), E::Magic { found: 5 });
    assert_eq!(error_of(1, |_| 2), E::Version { found: 2 });
    assert_eq!(error_of(6, |_| 9), E::Reserved { word: 6, found: 9 });
    let (found, limit) = (u32::MAX, 1 << 30);
    assert_eq!(error_of(2, |_| found), E::Triangles { found, limit });
    let (leaves, triangles) = (40, 39);
    assert_eq!(error_of(2, |_| 39), E::Leaves { leaves, triangles });
    for found in [0, 6, 41, u32::MAX] {
        let (least, most) = (7, 40);
        let expected = E::Levels {
            found,
            leaves,
            least,
            most,
        };
        assert_eq!(error_of(4, |_| found), expected);
    }
    let found = sample().words().len();
    let expected = found - 1;
    assert_eq!(error_of(3, |n| n - 1), E::Length { found, expected });
}

#[test]
fn a_tree_deeper_than_any_may_be_is_refused() {
    let chain = |levels: u32| {
        let header = [Topology::MAGIC, 1, levels, levels, levels, 0, 0, 0];
        let table = (0..levels).map(|level| u32::from(level + 1 < levels));
        let nodes = 2 * levels - 1;
        let is_leaf = |node: u32| node < nodes && (node % 2 == 1 || node + 1 == nodes);
        let word = |at: u32| (0..32).map(|i| u32::from(is_leaf(at * 32 + i)) << i).sum();
        let bits: Vec<u32> = (0..nodes.div_ceil(32)).map(word).collect();
        let rank = |at| bits[..at].iter().map(|word| word.count_ones()).sum();
        let ranks = (0..bits.len()).map(rank);
        let words = header.into_iter().chain(table).chain(bits.iter().copied());
        Topology::from_words(words.chain(ranks).chain(0..levels).collect())
    };
    assert_eq!(chain(65).map(|record| record.level_count()), Ok(65));
    let error = RecordError::Levels {
        found: 66,
        leaves: 66,
        least: 8,
        most: 65,
    };
    assert_eq!(chain(66), Err(error));
}

#[test]
fn each_property_of_the_levels_has_its_error() {
    use RecordError as E;
    for (level, found, nodes) in [(0, 2, 1), (1, 0, 2), (1, 3, 2)] {
        let expected = E::LevelInner {
            level,
            found,
            nodes,
            least: 1,
        };
        assert_eq!(error_of(8 + level, |_| found), expected);
    }
    let (level, found) = (sample().level_count() - 1, 1);
    assert_eq!(error_of(8 + level, |_| 1), E::LastLevel { level, found });
    let one_more = E::InnerSum {
        found: 40,
        leaves: 40,
        expected: 39,
    };
    assert_eq!(error_of(8 + level - 1, |k| k + 1), one_more);
}

#[test]
fn each_property_of_bits_and_leaves_has_its_error() {
    use RecordError as E;
    let bits = 8 + sample().level_count();
    let root_is_leaf = E::LeafBits {
        level: 0,
        first_node: 0,
        end_node: 1,
        found: 1,
        expected: 0,
    };
    assert_eq!(error_of(bits, |word| word | 1), root_is_leaf);
    let (word, last_node) = (bits + 2, 78);
    let found = sample().words()[word] | 1 << 31;
    let past_the_end = E::TrailingBits {
        word,
        found,
        last_node,
    };
    assert_eq!(error_of(word, |_| found), past_the_end);
    let (word, node, expected) = (bits + 4, 32, sample().words()[bits].count_ones());
    let one_more = E::Rank {
        word,
        node,
        found: expected + 1,
        expected,
    };
    assert_eq!(error_of(word, |rank| rank + 1), one_more);
    let (leaf, triangle) = (7, 500);
    let triangles = sample().triangle_count() as u32;
    let no_such = E::TriangleRange {
        leaf,
        triangle,
        triangles,
    };
    assert_eq!(error_of(bits + 6 + leaf, |_| triangle), no_such);
    let (triangle, first, second) = (sample().leaf_triangles()[2], 2, 7);
    let twice = E::TriangleTwice {
        triangle,
        first,
        second,
    };
    assert_eq!(error_of(bits + 6 + second, |_| triangle), twice);
}
