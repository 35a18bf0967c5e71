//! Every property a record must have.

use crate::header::Header;
use crate::{RecordError, Topology};
use bvh_build::MAX_DEPTH;
use geom::Animation;

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

fn check_header(words: &[u32]) -> Result<Header, RecordError> {
    let found = words.len();
    let Some(head) = words.first_chunk::<{ Topology::HEADER_WORDS }>() else {
        let expected = Topology::HEADER_WORDS;
        return Err(RecordError::Length { found, expected });
    };
    let &[magic, version, triangles, leaves, levels, ref reserved @ ..] = head;
    if magic != Topology::MAGIC {
        return Err(RecordError::Magic { found: magic });
    }
    if version != Topology::VERSION {
        return Err(RecordError::Version { found: version });
    }
    if let Some(at) = reserved.iter().position(|&word| word != 0) {
        let (word, found) = (5 + at, reserved[at]);
        return Err(RecordError::Reserved { word, found });
    }
    let header = Header {
        triangles,
        leaves,
        levels,
    };
    check_sizes(header)?;
    let expected = header.record_words();
    if found != expected {
        return Err(RecordError::Length { found, expected });
    }
    Ok(header)
}

fn check_sizes(header: Header) -> Result<(), RecordError> {
    let Header {
        triangles,
        leaves,
        levels,
    } = header;
    let limit = Animation::MAX_TRIANGLES;
    if triangles as usize > limit {
        let found = triangles;
        return Err(RecordError::Triangles { found, limit });
    }
    if leaves > triangles {
        return Err(RecordError::Leaves { leaves, triangles });
    }
    // Full levels are the fewest, one inner node a level the most.
    let least = match leaves {
        0 => 0,
        _ => leaves.next_power_of_two().ilog2() + 1,
    };
    let most = leaves.min(MAX_DEPTH + 1);
    if !(least..=most).contains(&levels) {
        return Err(RecordError::Levels {
            found: levels,
            leaves,
            least,
            most,
        });
    }
    Ok(())
}

fn check_level_table(header: Header, table: &[u32]) -> Result<(), RecordError> {
    let (mut nodes, mut sum) = (1, 0);
    for (level, &found) in table.iter().enumerate() {
        let is_last = level + 1 == table.len();
        let least = u32::from(!is_last);
        if found < least || u64::from(found) > nodes {
            return Err(RecordError::LevelInner {
                level,
                found,
                nodes,
                least,
            });
        }
        if is_last && found > 0 {
            return Err(RecordError::LastLevel { level, found });
        }
        nodes = 2 * u64::from(found);
        sum += u64::from(found);
    }
    let expected = header.leaves.saturating_sub(1);
    if sum != u64::from(expected) {
        return Err(RecordError::InnerSum {
            found: sum,
            leaves: header.leaves,
            expected,
        });
    }
    Ok(())
}

fn check_bits(
    header: Header,
    table: &[u32],
    bits: &[u32],
    first_word: usize,
) -> Result<(), RecordError> {
    let (mut first_node, mut nodes) = (0, 1);
    for (level, &inner) in table.iter().enumerate() {
        let end_node = first_node + nodes;
        let found = count_ones(bits, first_node, end_node);
        let expected = nodes - inner;
        if found != expected {
            return Err(RecordError::LeafBits {
                level,
                first_node,
                end_node,
                found,
                expected,
            });
        }
        (first_node, nodes) = (end_node, 2 * inner);
    }
    let used = header.node_count() % 32;
    match bits.last() {
        Some(&found) if used != 0 && found >> used != 0 => Err(RecordError::TrailingBits {
            word: first_word + bits.len() - 1,
            found,
            last_node: header.node_count() as u32 - 1,
        }),
        _ => Ok(()),
    }
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
    for (at, (word, &found)) in bits.iter().zip(ranks).enumerate() {
        if found != expected {
            return Err(RecordError::Rank {
                word: first_word + at,
                node: at as u32 * 32,
                found,
                expected,
            });
        }
        expected += word.count_ones();
    }
    Ok(())
}

/// Leaves name triangles of the scene, each at most once.
fn check_triangles(leaf_triangles: &[u32], triangles: u32) -> Result<(), RecordError> {
    let mut seen = vec![0_u64; (triangles as usize).div_ceil(64)];
    for (leaf, &triangle) in leaf_triangles.iter().enumerate() {
        if triangle >= triangles {
            return Err(RecordError::TriangleRange {
                leaf,
                triangle,
                triangles,
            });
        }
        let (word, bit) = (triangle as usize / 64, 1 << (triangle % 64));
        if seen[word] & bit != 0 {
            let first = leaf_triangles.iter().position(|&t| t == triangle);
            return Err(RecordError::TriangleTwice {
                triangle,
                first: first.unwrap_or(leaf),
                second: leaf,
            });
        }
        seen[word] |= bit;
    }
    Ok(())
}
