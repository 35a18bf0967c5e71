//! Validates records by encoding them again.

use crate::Topology;
use bvh_build::MAX_DEPTH;
use geom::Animation;

/// Describes an invalid topology and the position of the error. Word numbers start at 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TopologyError(String);

/// The first words, which determine all sizes. See [`Topology`] for the layout.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Header {
    pub(crate) triangles: u32,
    pub(crate) leaves: u32,
    pub(crate) levels: u32,
}

impl Header {
    pub(crate) fn words(self) -> [u32; Topology::HEADER_WORDS] {
        let mut words = [0; Topology::HEADER_WORDS];
        (words[0], words[1]) = (Topology::MAGIC, Topology::VERSION);
        (words[2], words[3], words[4]) = (self.triangles, self.leaves, self.levels);
        words
    }

    pub(crate) fn node_count(self) -> usize {
        (2 * self.leaves as usize).saturating_sub(1)
    }

    pub(crate) fn bit_words(self) -> usize {
        self.node_count().div_ceil(32)
    }

    pub(crate) fn record_words(self) -> usize {
        let table = Topology::HEADER_WORDS + self.levels as usize;
        table + 2 * self.bit_words() + self.leaves as usize
    }
}

/// Encodes a record again from its triangle count, leaf bits and leaf triangles, and compares the words.
/// No allocation is larger than `words`, whatever the words contain.
pub(crate) fn validate(words: &[u32]) -> Result<(), TopologyError> {
    let expected = remake(words)?;
    let differs = words.iter().zip(&expected).position(|(a, b)| a != b);
    differs.map_or(Ok(()), |at| {
        let (found, expected) = (words[at], expected[at]);
        let cause = format!("word {at} is {found:#x}, expected {expected:#x}");
        Err(TopologyError(cause))
    })
}

fn remake(words: &[u32]) -> Result<Vec<u32>, TopologyError> {
    let mut header = match words {
        &[_, _, triangles, leaves, levels, _, _, _, ..] => Header {
            triangles,
            leaves,
            levels,
        },
        _ => Header::default(),
    };
    let (found, expected) = (words.len(), header.record_words());
    let cause = format!("the record has {found} words, expected {expected} by its header");
    ensure(found == expected, cause)?;
    let body = &words[Topology::HEADER_WORDS + header.levels as usize..];
    let (bits, rest) = body.split_at(header.bit_words());
    let leaf_triangles = &rest[header.bit_words()..];
    check_triangles(leaf_triangles, header.triangles)?;
    let levels = inner_per_level(bits, header.node_count())?;
    header.levels = levels.len() as u32;
    let mut bits = bits.to_vec();
    if let Some(last) = bits.last_mut() {
        *last &= u32::MAX >> (31 - (header.node_count() - 1) % 32);
    }
    let ranks = bits.iter().scan(0, |leaves, word| {
        *leaves += word.count_ones();
        Some(*leaves - word.count_ones())
    });
    let ranks: Vec<u32> = ranks.collect();
    Ok([&header.words(), &levels[..], &bits, &ranks, leaf_triangles].concat())
}

fn ensure(holds: bool, cause: String) -> Result<(), TopologyError> {
    holds.then_some(()).ok_or(TopologyError(cause))
}

/// Checks that leaves refer to triangles of the scene, each at most once.
fn check_triangles(leaf_triangles: &[u32], scene: u32) -> Result<(), TopologyError> {
    let limit = Animation::MAX_TRIANGLES;
    let cause = format!("word 2 gives {scene} triangles, the limit is {limit}");
    ensure(scene as usize <= limit, cause)?;
    let mut sorted = leaf_triangles.to_vec();
    sorted.sort_unstable();
    let is_distinct = sorted.windows(2).all(|pair| pair[0] < pair[1]);
    let is_below = sorted.last().is_none_or(|&last| last < scene);
    let cause = format!("a triangle index occurs in two leaves, or is not below {scene}");
    ensure(is_distinct && is_below, cause)
}

/// Counts the inner nodes of each level. Their children form the next level.
fn inner_per_level(bits: &[u32], all: usize) -> Result<Vec<u32>, TopologyError> {
    let (mut levels, mut nodes) = (Vec::new(), 0..all.min(1));
    while !nodes.is_empty() && nodes.end <= all {
        let is_inner = |&node: &usize| bits[node / 32] >> (node % 32) & 1 == 0;
        let inner = nodes.clone().filter(is_inner).count();
        levels.push(inner as u32);
        nodes = nodes.end..nodes.end + 2 * inner;
    }
    let (found, most) = (levels.len(), MAX_DEPTH as usize + 1);
    let cause =
        format!("the leaf bits do not describe a tree of {all} nodes and at most {most} levels");
    ensure(nodes.end == all && found <= most, cause)?;
    Ok(levels)
}
