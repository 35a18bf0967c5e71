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

    pub(crate) fn record_words(self) -> usize {
        let table = Topology::HEADER_WORDS + self.levels as usize;
        table + 2 * self.bit_words() + self.leaves as usize
    }
}

/// Checks everything. Each check relies on those before it, and only on them.
pub(crate) fn validate(words: &[u32]) -> Result<(), RecordError> {
    let header = check_header(words)?;
    let (table, body) = words[Topology::HEADER_WORDS..].split_at(header.levels as usize);
    let (bits, body) = body.split_at(header.bit_words());
    let (ranks, leaf_triangles) = body.split_at(header.bit_words());
    check_levels(header, table, bits)?;
    let used = header.node_count() % 32;
    let past = bits
        .last()
        .filter(|_| used > 0)
        .map_or(0, |bits| bits >> used);
    ensure(past == 0, || {
        let last = header.node_count() - 1;
        format!("bits past the last node {last} must be 0, they are {past:#x}")
    })?;
    check_ranks(bits, ranks)?;
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
    let reserved = &words[5..Topology::HEADER_WORDS];
    ensure(reserved.iter().all(|&word| word == 0), || {
        format!("words 5 to 7 are {reserved:?}, they are reserved and must be 0")
    })?;
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
    let (limit, most) = (Animation::MAX_TRIANGLES, MAX_DEPTH + 1);
    let [triangles, leaves, levels] = [header.triangles, header.leaves, header.levels];
    ensure(triangles as usize <= limit, || {
        format!("word 2 gives {triangles} triangles, the limit is {limit}")
    })?;
    ensure(leaves <= triangles, || {
        format!("word 3 gives {leaves} leaves, the scene has {triangles} triangles")
    })?;
    ensure(levels <= most, || {
        format!("word 4 gives {levels} levels, the limit is {most}")
    })
}

/// The bits of each level tell its inner nodes, whose children are the next level.
fn check_levels(header: Header, table: &[u32], bits: &[u32]) -> Result<(), RecordError> {
    let all = header.node_count();
    let (mut first, mut nodes) = (0, all.min(1));
    for (level, &found) in table.iter().enumerate() {
        let (end, left) = (first + nodes, all - first);
        ensure((1..=left).contains(&nodes), || {
            format!("level {level} has {nodes} nodes, {left} are left")
        })?;
        let inner = nodes - count_ones(bits, first, end);
        ensure(found as usize == inner, || {
            format!("level {level} has {found} inner nodes, its bits have {inner}")
        })?;
        (first, nodes) = (end, 2 * inner);
    }
    let (leaves, levels) = (header.leaves, header.levels);
    ensure((first, nodes) == (all, 0), || {
        format!("{levels} levels have {first} nodes, {leaves} leaves make {all}")
    })
}

/// Ones among the bits `first..end`, where `first < end`.
fn count_ones(bits: &[u32], first: usize, end: usize) -> usize {
    let words = &bits[first / 32..=(end - 1) / 32];
    let all: u32 = words.iter().map(|word| word.count_ones()).sum();
    let before = words[0] & !(u32::MAX << (first % 32));
    let after = words[words.len() - 1] & (u32::MAX << 1 << ((end - 1) % 32));
    (all - before.count_ones() - after.count_ones()) as usize
}

fn check_ranks(bits: &[u32], ranks: &[u32]) -> Result<(), RecordError> {
    let mut expected = 0;
    for (node, (bits, &found)) in (0_usize..).step_by(32).zip(bits.iter().zip(ranks)) {
        ensure(found == expected, || {
            format!("{found} leaves are counted before node {node}, there are {expected}")
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
            let first = leaf_triangles.iter().position(|&t| t == triangle);
            let first = first.unwrap_or(leaf);
            format!("leaves {first} and {leaf} both name triangle {triangle}")
        })?;
        seen[word] |= bit;
    }
    Ok(())
}
