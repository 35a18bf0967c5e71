//! The words that come first: all sizes follow from them.

use crate::Topology;

/// A record's header; see [`Topology`] for the layout.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Header {
    pub(crate) triangles: u32,
    pub(crate) leaves: u32,
    pub(crate) levels: u32,
}

impl Header {
    pub(crate) fn words(self) -> [u32; Topology::HEADER_WORDS] {
        let Self {
            triangles,
            leaves,
            levels,
        } = self;
        [
            Topology::MAGIC,
            Topology::VERSION,
            triangles,
            leaves,
            levels,
            0,
            0,
            0,
        ]
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
