//! Every property a record must have.

use crate::Topology;
use bvh_build::MAX_DEPTH;
use geom::Animation;

/// What is wrong with a record, and where. Words, levels, nodes and leaves count from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RecordError(String);

/// The words that come first, from which all sizes follow; see [`Topology`] for the layout.
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

    /// Words of the whole record.
    pub(crate) fn record_words(self) -> usize {
        let table = Topology::HEADER_WORDS + self.levels as usize;
        table + 2 * self.bit_words() + self.leaves as usize
    }
}

/// Checks everything. Each check relies on those before it, and only on them.
pub(crate) fn validate(words: &[u32]) -> Result<(), RecordError> {
    let header = check_header(words)?;
    let (table, body) = words[Topology::HEADER_WORDS..].split_at(header.levels as usize);
    check_level_table(header, table)?;
    let (bits, body) = body.split_at(header.bit_words());
    let (ranks, leaf_triangles) = body.split_at(header.bit_words());
    let first_bit_word = Topology::HEADER_WORDS + table.len();
    check_bits(header, table, bits, first_bit_word)?;
    check_ranks(bits, ranks, first_bit_word + bits.len())?;
    check_triangles(leaf_triangles, header.triangles)
}

fn ensure(holds: bool, cause: impl FnOnce() -> String) -> Result<(), RecordError> {
    match holds {
        true => Ok(()),
        false => Err(RecordError(cause())),
    }
}

fn check_header(words: &[u32]) -> Result<Header, RecordError> {
    let found = words.len();
    let of_length = |holds, expected: usize| {
        ensure(holds, || {
            format!("the record has {found} words, its header asks for {expected}")
        })
    };
    of_length(found >= Topology::HEADER_WORDS, Topology::HEADER_WORDS)?;
    let (magic, version) = (Topology::MAGIC, Topology::VERSION);
    ensure(words[0] == magic, || {
        let found = words[0];
        format!("word 0 is {found:#010x}, a record begins with {magic:#010x}")
    })?;
    ensure(words[1] == version, || {
        let found = words[1];
        format!("word 1 gives layout version {found}, only {version} is known")
    })?;
    for (word, found) in (5..).zip(&words[5..Topology::HEADER_WORDS]) {
        ensure(*found == 0, || {
            format!("word {word} is {found}, it is reserved and must be 0")
        })?;
    }
    let header = Header {
        triangles: words[2],
        leaves: words[3],
        levels: words[4],
    };
    check_sizes(header)?;
    of_length(found == header.record_words(), header.record_words())?;
    Ok(header)
}

fn check_sizes(header: Header) -> Result<(), RecordError> {
    let Header {
        triangles,
        leaves,
        levels,
    } = header;
    let limit = Animation::MAX_TRIANGLES;
    ensure(triangles as usize <= limit, || {
        format!("word 2 gives {triangles} triangles, the limit is {limit}")
    })?;
    ensure(leaves <= triangles, || {
        format!("word 3 gives {leaves} leaves, the scene has {triangles} triangles")
    })?;
    // Full levels are the fewest, one inner node a level the most.
    let least = match leaves {
        0 => 0,
        _ => leaves.next_power_of_two().ilog2() + 1,
    };
    let most = leaves.min(MAX_DEPTH + 1);
    ensure((least..=most).contains(&levels), || {
        format!("word 4 gives {levels} levels, {leaves} leaves need {least} to {most}")
    })
}

fn check_level_table(header: Header, table: &[u32]) -> Result<(), RecordError> {
    let (mut nodes, mut sum) = (1, 0);
    for (level, &found) in table.iter().enumerate() {
        let is_last = level + 1 == table.len();
        let (inner, least) = (u64::from(found), u64::from(!is_last));
        ensure((least..=nodes).contains(&inner), || {
            format!(
                "level {level} has {found} inner nodes, its {nodes} nodes allow {least} to {nodes}"
            )
        })?;
        ensure(!is_last || found == 0, || {
            format!("level {level} is the last, but has {found} inner nodes")
        })?;
        nodes = 2 * inner;
        sum += inner;
    }
    let leaves = header.leaves;
    let expected = u64::from(leaves.saturating_sub(1));
    ensure(sum == expected, || {
        format!("the levels have {sum} inner nodes, {leaves} leaves imply {expected}")
    })
}

fn check_bits(
    header: Header,
    table: &[u32],
    bits: &[u32],
    first_word: usize,
) -> Result<(), RecordError> {
    let (mut first, mut nodes) = (0, 1);
    for (level, &inner) in table.iter().enumerate() {
        let end = first + nodes;
        let (found, expected) = (count_ones(bits, first, end), nodes - inner);
        ensure(found == expected, || {
            format!(
                "level {level}, nodes {first}..{end}: {found} bits mark leaves, the level table implies {expected}"
            )
        })?;
        (first, nodes) = (end, 2 * inner);
    }
    let (count, last_word) = (header.node_count(), bits.last().copied().unwrap_or(0));
    ensure(count % 32 == 0 || last_word >> (count % 32) == 0, || {
        let (word, last) = (first_word + bits.len() - 1, count - 1);
        format!("word {word} is {last_word:#010x}, bits past the last node {last} must be 0")
    })
}

/// Ones among the bits `first..end`, where `first < end`.
fn count_ones(bits: &[u32], first: u32, end: u32) -> u32 {
    let (first_word, last_word) = (first / 32, (end - 1) / 32);
    let words = &bits[first_word as usize..=last_word as usize];
    let all: u32 = words.iter().map(|word| word.count_ones()).sum();
    let before = words[0] & !(u32::MAX << (first % 32));
    let after = words[words.len() - 1] & (u32::MAX << 1 << ((end - 1) % 32));
    all - before.count_ones() - after.count_ones()
}

fn check_ranks(bits: &[u32], ranks: &[u32], first_word: usize) -> Result<(), RecordError> {
    let mut expected = 0;
    for (at, (bits, &found)) in bits.iter().zip(ranks).enumerate() {
        ensure(found == expected, || {
            let (word, node) = (first_word + at, at * 32);
            format!("word {word} counts {found} leaves before node {node}, there are {expected}")
        })?;
        expected += bits.count_ones();
    }
    Ok(())
}

/// Leaves name triangles of the scene, each at most once.
fn check_triangles(leaf_triangles: &[u32], triangles: u32) -> Result<(), RecordError> {
    let mut seen = vec![0_u64; (triangles as usize).div_ceil(64)];
    for (leaf, &triangle) in leaf_triangles.iter().enumerate() {
        ensure(triangle < triangles, || {
            format!("leaf {leaf} names triangle {triangle}, the scene has {triangles}")
        })?;
        let (word, bit) = (triangle as usize / 64, 1 << (triangle % 64));
        ensure(seen[word] & bit == 0, || {
            let mut leaves = leaf_triangles.iter();
            let first = leaves.position(|&t| t == triangle).unwrap_or(leaf);
            format!("leaves {first} and {leaf} both name triangle {triangle}")
        })?;
        seen[word] |= bit;
    }
    Ok(())
}
