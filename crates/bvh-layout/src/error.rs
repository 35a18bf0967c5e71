//! What can be wrong with a record.

use crate::Topology;

/// What is wrong with a record. Words, levels, nodes and leaves count from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The bytes do not make whole words.
    #[error("{found} bytes are not a whole number of 4-byte words")]
    Bytes {
        /// Bytes there are.
        found: usize,
    },
    /// The words end before the record does, or go on after it.
    #[error("the record has {found} words, its header asks for {expected}")]
    Length {
        /// Words there are.
        found: usize,
        /// Words there should be.
        expected: usize,
    },
    /// It is no record at all.
    #[error(
        "word 0 is {found:#010x}, a record begins with {:#010x}",
        Topology::MAGIC
    )]
    Magic {
        /// Word 0.
        found: u32,
    },
    /// The layout is not one that this crate knows.
    #[error(
        "word 1 gives layout version {found}, only {} is known",
        Topology::VERSION
    )]
    Version {
        /// Word 1.
        found: u32,
    },
    /// A word kept for later versions is used.
    #[error("word {word} is {found}, it is reserved and must be 0")]
    Reserved {
        /// The word.
        word: usize,
        /// What it holds.
        found: u32,
    },
    /// The scene is larger than any scene may be.
    #[error("word 2 gives {found} triangles, the limit is {limit}")]
    Triangles {
        /// Word 2.
        found: u32,
        /// [`geom::Animation::MAX_TRIANGLES`].
        limit: usize,
    },
    /// The tree has more leaves than the scene has triangles.
    #[error("word 3 gives {leaves} leaves, the scene has {triangles} triangles")]
    Leaves {
        /// Word 3.
        leaves: u32,
        /// Word 2.
        triangles: u32,
    },
    /// No tree of so many leaves has so many levels.
    #[error("word 4 gives {found} levels, {leaves} leaves need {least} to {most}")]
    Levels {
        /// Word 4.
        found: u32,
        /// Word 3.
        leaves: u32,
        /// The fewest levels there may be.
        least: u32,
        /// The most levels there may be.
        most: u32,
    },
    /// A level has more inner nodes than nodes, or one before the last has none.
    #[error("level {level} has {found} inner nodes, its {nodes} nodes allow {least} to {nodes}")]
    LevelInner {
        /// The level.
        level: usize,
        /// Its entry in the level table.
        found: u32,
        /// Its nodes: twice the inner nodes of the level before.
        nodes: u64,
        /// 0 for the last level, else 1.
        least: u32,
    },
    /// The last level has inner nodes, whose children would lie on no level.
    #[error("level {level} is the last, but has {found} inner nodes")]
    LastLevel {
        /// The level.
        level: usize,
        /// Its entry in the level table.
        found: u32,
    },
    /// The level table counts another number of inner nodes than the leaves imply.
    #[error("the levels have {found} inner nodes, {leaves} leaves imply {expected}")]
    InnerSum {
        /// The table's sum.
        found: u64,
        /// Word 3.
        leaves: u32,
        /// One less than the leaves.
        expected: u32,
    },
    /// The bits of a level mark another number of leaves than the level table implies.
    #[error(
        "level {level}, nodes {first_node}..{end_node}: {found} bits mark leaves, the level table implies {expected}"
    )]
    LeafBits {
        /// The level.
        level: usize,
        /// Its first node.
        first_node: u32,
        /// The node after its last.
        end_node: u32,
        /// Bits that are 1.
        found: u32,
        /// Its nodes less its inner nodes.
        expected: u32,
    },
    /// A bit past the last node is 1.
    #[error("word {word} is {found:#010x}, bits past the last node {last_node} must be 0")]
    TrailingBits {
        /// The word, counted from the record's start.
        word: usize,
        /// What it holds.
        found: u32,
        /// The last node.
        last_node: u32,
    },
    /// The rank directory does not agree with the bits.
    #[error("word {word} counts {found} leaves before node {node}, there are {expected}")]
    Rank {
        /// The word, counted from the record's start.
        word: usize,
        /// The first node whose bit the counted word holds.
        node: u32,
        /// What the word holds.
        found: u32,
        /// Ones in the bits before.
        expected: u32,
    },
    /// A leaf names a triangle that does not exist.
    #[error("leaf {leaf} names triangle {triangle}, the scene has {triangles}")]
    TriangleRange {
        /// The leaf, in node order.
        leaf: usize,
        /// What it names.
        triangle: u32,
        /// Word 2.
        triangles: u32,
    },
    /// Two leaves name the same triangle.
    #[error("leaves {first} and {second} both name triangle {triangle}")]
    TriangleTwice {
        /// The triangle.
        triangle: u32,
        /// The first leaf that names it.
        first: usize,
        /// The second.
        second: usize,
    },
}
