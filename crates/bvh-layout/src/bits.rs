//! One bit a node, and the directory that ranks leaves.

use rayon::prelude::*;

/// Words of bits packed by one task.
const TASK: usize = 1 << 12;

/// Children of inner node `k` are nodes `2k + 1` and `2k + 2`: packs two bits a node, one place up.
pub(crate) fn pack(leaf_children: &[u8], bits: &mut [u32]) {
    let tasks = bits.par_chunks_mut(TASK).enumerate();
    tasks.for_each(|(task, bits)| {
        let first = task * TASK * 16;
        let mut carry = match first.checked_sub(1) {
            Some(before) => u32::from(leaf_children[before] >> 1),
            None => u32::from(leaf_children.is_empty()),
        };
        let mut nodes = leaf_children[first..].chunks(16);
        for word in bits {
            let pairs = nodes.next().map_or(0, pairs);
            *word = pairs << 1 | carry;
            carry = pairs >> 31;
        }
    });
}

/// Two bits of each of up to 16 bytes, the first lowest.
fn pairs(bytes: &[u8]) -> u32 {
    let join = |pairs, (i, &byte): (usize, &u8)| pairs | u32::from(byte) << (2 * i);
    bytes.iter().enumerate().fold(0, join)
}

/// For each word, the ones before it.
pub(crate) fn rank(bits: &[u32], ranks: &mut [u32]) {
    let mut before = 0;
    for (word, rank) in bits.iter().zip(ranks) {
        *rank = before;
        before += word.count_ones();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Node by node, as the layout's description says.
    fn pack_slowly(leaf_children: &[u8]) -> Vec<u32> {
        let root = u8::from(leaf_children.is_empty());
        let children = leaf_children.iter().flat_map(|b| [b & 1, b >> 1]);
        let nodes: Vec<u8> = [root].into_iter().chain(children).collect();
        let word = |nodes: &[u8]| (0..nodes.len()).map(|i| u32::from(nodes[i]) << i).sum();
        nodes.chunks(32).map(word).collect()
    }

    #[test]
    fn tasks_and_words_join_without_a_seam() {
        for inner in [
            0,
            1,
            15,
            16,
            17,
            16 * TASK - 1,
            16 * TASK,
            16 * TASK + 1,
            40 * TASK,
        ] {
            let leaf_children: Vec<u8> = (0..inner).map(|i| (i * 5 / 3 % 4) as u8).collect();
            let expected = pack_slowly(&leaf_children);
            let mut bits = vec![u32::MAX; expected.len()];
            pack(&leaf_children, &mut bits);
            assert_eq!(bits, expected, "{inner} inner nodes");
        }
    }

    #[test]
    fn a_rank_leaves_its_own_word_out() {
        let mut ranks = [9; 3];
        rank(&[0b1011, 0, u32::MAX], &mut ranks);
        assert_eq!(ranks, [0, 3, 3]);
    }
}
