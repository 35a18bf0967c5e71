//! The tree in use: its record twice (one in use, one arriving), its lists, records and nodes once.

use crate::buffers::{storage, write};
use crate::device::Gpu;
use backend::{Generation, Result, check_tree};
use bvh_layout::{Level, Topology};
use geom::Animation;
use std::sync::Arc;
use wgpu::Buffer;

pub(crate) struct TreeBuffers {
    /// Two, so that a tree can arrive while frames before it still read the old one.
    records_of: [Option<Buffer>; 2],
    current: usize,
    pub(crate) leaf_nodes: Buffer,
    pub(crate) inner_nodes: Buffer,
    pub(crate) triangles: Buffer,
    pub(crate) nodes: Buffer,
    pub(crate) generation: Generation,
    pub(crate) levels: Vec<Level>,
    /// Where the record's parts begin, in words.
    pub(crate) parts: Parts,
    pub(crate) leaf_count: u32,
    pub(crate) node_count: u32,
    animation: Arc<Animation>,
}

#[derive(Clone, Copy, Default)]
pub(crate) struct Parts {
    pub(crate) leaf_bits: u32,
    pub(crate) leaf_ranks: u32,
    pub(crate) leaf_triangles: u32,
}

impl TreeBuffers {
    /// Room for every tree over the animation's live triangles.
    pub(crate) fn new(gpu: &Gpu, animation: &Arc<Animation>) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let nodes = (2 * leaves).saturating_sub(1);
        gpu.within("the tree's nodes", nodes * 32)?;
        gpu.within("the triangles' records", leaves * 48)?;
        Ok(Self {
            records_of: [None, None],
            current: 0,
            leaf_nodes: storage(gpu, "the list of leaves", leaves * 4)?,
            inner_nodes: storage(gpu, "the list of inner nodes", leaves * 4)?,
            triangles: storage(gpu, "the triangles' records", leaves * 48)?,
            nodes: storage(gpu, "the tree's nodes", nodes * 32)?,
            generation: Generation(0),
            levels: Vec::new(),
            parts: Parts::default(),
            leaf_count: 0,
            node_count: 0,
            animation: Arc::clone(animation),
        })
    }

    /// The record in use.
    ///
    /// # Panics
    /// Before the first tree was adopted.
    pub(crate) fn topology(&self) -> &Buffer {
        let record = self.records_of[self.current].as_ref();
        record.expect("a tree was adopted")
    }

    /// Puts `tree` in the other one's place, for all that is submitted from now on.
    pub(crate) fn adopt(
        &mut self,
        gpu: &Gpu,
        tree: &Topology,
        generation: Generation,
    ) -> Result<()> {
        check_tree(tree, &self.animation)?;
        let bytes = tree.bytes() as u64;
        gpu.within("the tree's record", bytes)?;
        let spare = 1 - self.current;
        let record = match self.records_of[spare].take().filter(|r| r.size() >= bytes) {
            Some(record) => record,
            None => storage(gpu, "the tree's record", bytes)?,
        };
        write(gpu, &record, 0, tree.words())?;
        self.records_of[spare] = Some(record);
        self.current = spare;
        self.generation = generation;
        self.leaf_count = tree.leaf_count() as u32;
        self.node_count = tree.node_count() as u32;
        self.levels = tree.levels().collect();
        self.parts = Parts::of(tree);
        Ok(())
    }
}

impl Parts {
    fn of(tree: &Topology) -> Self {
        let bits = Topology::HEADER_WORDS + tree.level_count();
        let words = tree.leaf_bits().len();
        Self {
            leaf_bits: bits as u32,
            leaf_ranks: (bits + words) as u32,
            leaf_triangles: (bits + 2 * words) as u32,
        }
    }
}
