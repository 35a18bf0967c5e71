//! Trees that no builder would make: odd, foreign and damaged ones.

use bvh_build::MAX_DEPTH;
use bvh_layout::Topology;
use geom::Animation;

/// How a node's leaves are shared out among its children.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Split {
    /// All but one to the left: a chain as deep as a tree may be.
    LeftChain,
    /// All but one to the right.
    RightChain,
    /// Now left, now right.
    Zigzag,
    /// Whatever.
    Random,
}

impl Split {
    pub(crate) const ALL: [Self; 4] = [
        Self::LeftChain,
        Self::RightChain,
        Self::Zigzag,
        Self::Random,
    ];

    fn left(self, leaves: usize, depth: u32, rng: &mut fastrand::Rng) -> usize {
        // The record's depth is bounded: once the levels left hold no more than the leaves, trees are full.
        let room = 1_usize << (MAX_DEPTH - depth - 1).min(40);
        let wanted = match self {
            Self::LeftChain => leaves - 1,
            Self::RightChain => 1,
            Self::Zigzag if depth.is_multiple_of(2) => 1,
            Self::Zigzag => leaves - 1,
            Self::Random => rng.usize(1..leaves),
        };
        wanted.clamp(leaves.saturating_sub(room).max(1), room.min(leaves - 1))
    }
}

/// The triangles that a tree of the scene must hold, shuffled.
pub(crate) fn live(animation: &Animation, chance: u64) -> Vec<u32> {
    let all = 0..animation.triangle_count() as u32;
    let mut live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
    fastrand::Rng::with_seed(chance).shuffle(&mut live);
    live
}

/// A sound record like a tree's, split in some odd way.
pub(crate) fn odd(triangles: usize, leaves: &[u32], split: Split, chance: u64) -> Vec<u32> {
    let mut rng = fastrand::Rng::with_seed(chance);
    record(triangles, leaves, |depth, leaves| {
        split.left(leaves, depth, &mut rng)
    })
}

/// A sound record over `leaves`, left to right, for a scene of `triangles` triangles: `split` says, by a node's depth and
/// its number of leaves, how many are its left child's.
pub fn record(
    triangles: usize,
    leaves: &[u32],
    mut split: impl FnMut(u32, usize) -> usize,
) -> Vec<u32> {
    let (mut table, mut is_leaf, mut order) = (Vec::new(), Vec::new(), Vec::new());
    let mut level: Vec<&[u32]> = Some(leaves)
        .filter(|all| !all.is_empty())
        .into_iter()
        .collect();
    while !level.is_empty() {
        let mut next = Vec::new();
        for node in level {
            is_leaf.push(node.len() == 1);
            if let [leaf] = node {
                order.push(*leaf);
            } else {
                let (left, right) = node.split_at(split(table.len() as u32, node.len()));
                next.extend([left, right]);
            }
        }
        table.push(next.len() as u32 / 2);
        level = next;
    }
    let (triangles, leaves) = (triangles as u32, order.len() as u32);
    let mut words = vec![Topology::MAGIC, Topology::VERSION, triangles, leaves];
    words.extend([table.len() as u32, 0, 0, 0]);
    words.extend(table);
    let pack = |bits: &[bool]| (0..32).zip(bits).map(|(i, &b)| u32::from(b) << i).sum();
    let bits: Vec<u32> = is_leaf.chunks(32).map(pack).collect();
    let ranks = bits.iter().scan(0, |before, word| {
        let rank = *before;
        *before += word.count_ones();
        Some(rank)
    });
    let ranks: Vec<u32> = ranks.collect();
    words.extend([bits, ranks, order].concat());
    words
}

/// Sound records that are not of this scene, each with what is wrong.
pub(crate) fn foreign(animation: &Animation, chance: u64) -> Vec<(&'static str, Vec<u32>)> {
    let count = animation.triangle_count();
    let live = live(animation, chance);
    let of = |count, leaves: &[u32]| odd(count, leaves, Split::Random, chance);
    let fewer = live.split_last().map_or(&[][..], |(_, rest)| rest);
    let with = |more: u32| [fewer, &[more]].concat();
    let never = (0..count as u32).find(|&t| !animation.is_live(t));
    let mut all = vec![("a scene with one triangle more", of(count + 1, &live))];
    if !live.is_empty() {
        all.push(("one live triangle without a leaf", of(count, fewer)));
        let beyond = of(count + 1, &with(count as u32));
        all.push(("a leaf of a triangle that is not there", beyond));
    }
    if live.len() != 1 {
        all.push(("a tree of one leaf", of(count.max(1), &[0])));
    }
    if let Some(never) = never {
        let more = of(count, &[&live[..], &[never]].concat());
        all.push(("a leaf of a triangle that is never active", more));
    }
    if let Some(never) = never.filter(|_| !live.is_empty()) {
        let instead = of(count, &with(never));
        all.push(("a triangle never active instead of a live one", instead));
    }
    all
}

/// Records of which exactly one thing is wrong, each with what it is. `words` must have two leaves or more.
pub(crate) fn damaged(words: &[u32]) -> Vec<(&'static str, Vec<u32>)> {
    let (scene, leaves, levels) = (words[2], words[3], words[4] as usize);
    let nodes = 2 * leaves as usize - 1;
    let bits = Topology::HEADER_WORDS + levels;
    let ranks = bits + nodes.div_ceil(32);
    let order = ranks + nodes.div_ceil(32);
    let with = |at: usize, word: u32| {
        let mut words = words.to_vec();
        words[at] = word;
        words
    };
    let mut all = vec![
        ("no words", Vec::new()),
        ("a header cut short", words[..7].to_vec()),
        ("a word too few", words[..words.len() - 1].to_vec()),
        ("a word too many", [words, &[0]].concat()),
        ("other magic", with(0, words[0].swap_bytes())),
        ("a later version", with(1, 2)),
        ("a reserved word used", with(7, 1)),
        ("more triangles than any scene", with(2, 1 << 31)),
        ("more leaves than triangles", with(2, leaves - 1)),
        ("no levels", with(4, 0)),
        ("more levels than leaves", with(4, leaves + 1)),
        ("a root that is a leaf", with(8, 0)),
        ("more inner nodes than nodes", with(8, 2)),
        ("inner nodes on the last level", with(bits - 1, 1)),
        ("a leaf bit flipped", with(bits, words[bits] ^ 1)),
        ("a rank off by one", with(ranks, words[ranks] + 1)),
        ("a triangle that is not there", with(order, scene)),
        ("a triangle twice", with(order, words[order + 1])),
    ];
    if !nodes.is_multiple_of(32) {
        let last = words[ranks - 1] | 1 << 31;
        all.push(("a bit past the last node", with(ranks - 1, last)));
    }
    // The level before the last cannot have fewer inner nodes and still have as many leaves.
    if levels > 2 && words[bits - 2] > 1 {
        let fewer = words[bits - 2] - 1;
        all.push(("levels of another number of leaves", with(bits - 2, fewer)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn odd_trees_are_sound_and_as_deep_as_may_be() {
        for n in [0, 1, 2, 3, 40, 65, 66, 300] {
            let leaves: Vec<u32> = (0..n).collect();
            for split in Split::ALL {
                let words = odd(n as usize + 2, &leaves, split, 7);
                let tree = Topology::from_words(words).unwrap();
                assert_eq!(tree.leaf_count(), n as usize);
                let levels = tree.level_count();
                if n > 65 && split != Split::Random {
                    assert_eq!(levels, MAX_DEPTH as usize + 1, "{split:?}");
                }
            }
        }
    }

    #[test]
    fn every_kind_of_damage_is_among_the_damaged() {
        let leaves: Vec<u32> = (0..40).collect();
        let words = odd(40, &leaves, Split::Random, 1);
        let kind = |(what, words)| {
            let error = Topology::from_words(words).expect_err(what).to_string();
            error.replace(|c: char| c.is_ascii_hexdigit(), "")
        };
        let kinds: HashSet<String> = damaged(&words).into_iter().map(kind).collect();
        assert_eq!(kinds.len(), 14, "{kinds:#?}");
    }
}
