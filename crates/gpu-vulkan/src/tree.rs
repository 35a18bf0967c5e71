//! The tree in use: its record twice (one in use, one arriving), its lists, records and nodes once.

use crate::device::Gpu;
use crate::memory::{Buffer, Place};
use crate::scene::within;
use crate::transfer::Transfer;
use backend::{Generation, Result, Ticket, check_tree};
use bvh_layout::{Level, Topology};
use geom::Animation;
use std::sync::Arc;

pub(crate) struct TreeBuffers {
    records_of: [Option<Record>; 2],
    current: usize,
    pub(crate) leaf_nodes: Buffer,
    pub(crate) inner_nodes: Buffer,
    pub(crate) triangles: Buffer,
    pub(crate) nodes: Buffer,
    /// Partial sums of areas: see refit.wgsl.
    pub(crate) costs: Buffer,
    pub(crate) generation: Generation,
    pub(crate) levels: Vec<Level>,
    /// Where the record's parts begin, in words.
    pub(crate) parts: Parts,
    pub(crate) leaf_count: u32,
    pub(crate) node_count: u32,
    /// The upload that the next submission has to wait for.
    pub(crate) arriving: Option<u64>,
    animation: Arc<Animation>,
}

/// One record on the host and on the device.
struct Record {
    host: Buffer,
    device: Buffer,
    /// The last submission that reads it, and the upload that filled it.
    used_by: Option<Ticket>,
    filled_at: u64,
}

#[derive(Clone, Copy, Default)]
pub(crate) struct Parts {
    pub(crate) leaf_bits: u32,
    pub(crate) leaf_ranks: u32,
    pub(crate) leaf_triangles: u32,
}

impl TreeBuffers {
    /// Room for every tree over the animation's live triangles.
    pub(crate) fn new(gpu: &Arc<Gpu>, animation: &Arc<Animation>) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let nodes = (2 * leaves).saturating_sub(1);
        within(gpu, "the tree's nodes", nodes * 32)?;
        within(gpu, "the triangles' records", leaves * 48)?;
        let device = |what, bytes| Buffer::new(gpu, what, bytes, Place::Device);
        Ok(Self {
            records_of: [None, None],
            current: 0,
            leaf_nodes: device("the list of leaves", leaves * 4)?,
            inner_nodes: device("the list of inner nodes", leaves * 4)?,
            triangles: device("the triangles' records", leaves * 48)?,
            nodes: device("the tree's nodes", nodes * 32)?,
            costs: device("the tree's areas", shaders::Shape::cost_bytes(leaves))?,
            generation: Generation(0),
            levels: Vec::new(),
            parts: Parts::default(),
            leaf_count: 0,
            node_count: 0,
            arriving: None,
            animation: Arc::clone(animation),
        })
    }

    /// The record in use.
    ///
    /// # Panics
    /// Before the first tree was adopted.
    pub(crate) fn topology(&self) -> &Buffer {
        let record = self.records_of[self.current].as_ref();
        &record.expect("a tree was adopted").device
    }

    /// Notes that `ticket` reads the record in use.
    pub(crate) fn use_by(&mut self, ticket: Ticket) {
        if let Some(record) = &mut self.records_of[self.current] {
            record.used_by = Some(ticket);
        }
    }

    /// The last submission that reads the record which the next adoption overwrites.
    pub(crate) fn spare_used_by(&self) -> Option<Ticket> {
        self.records_of[1 - self.current]
            .as_ref()
            .and_then(|r| r.used_by)
    }

    /// Sends `tree` on its way. The spare record must not be in use any more.
    pub(crate) fn adopt(
        &mut self,
        gpu: &Arc<Gpu>,
        transfer: &mut Transfer,
        tree: &Topology,
        generation: Generation,
    ) -> Result<()> {
        check_tree(tree, &self.animation)?;
        let bytes = tree.bytes() as u64;
        let spare = 1 - self.current;
        let record = match self.records_of[spare]
            .take()
            .filter(|r| r.device.bytes >= bytes)
        {
            Some(record) => record,
            None => Record::new(gpu, bytes)?,
        };
        self.records_of[spare] = Some(record);
        let record = self.records_of[spare].as_mut().expect("just put there");
        transfer.wait(record.filled_at)?;
        record.host.write(0, tree.words());
        record.filled_at = transfer.copy(&record.host, &record.device, bytes, None)?;
        record.used_by = None;
        self.arriving = Some(record.filled_at);
        self.current = spare;
        self.generation = generation;
        self.leaf_count = tree.leaf_count() as u32;
        self.node_count = tree.node_count() as u32;
        self.levels = tree.levels().collect();
        let bits = Topology::HEADER_WORDS + tree.level_count();
        let words = tree.leaf_bits().len();
        self.parts = Parts {
            leaf_bits: bits as u32,
            leaf_ranks: (bits + words) as u32,
            leaf_triangles: (bits + 2 * words) as u32,
        };
        Ok(())
    }
}

impl Record {
    fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self> {
        within(gpu, "the tree's record", bytes)?;
        Ok(Self {
            host: Buffer::new(gpu, "the tree's record", bytes, Place::Upload)?,
            device: Buffer::new(gpu, "the tree's record", bytes, Place::Device)?,
            used_by: None,
            filled_at: 0,
        })
    }
}
