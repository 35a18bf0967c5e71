//! The tree in use: records of it and of those arriving, its lists, records of triangles and nodes once.

use crate::device::Gpu;
use crate::frames::Frames;
use crate::memory::{Buffer, Place};
use crate::rebuild::BuildBuffers;
use crate::transfer::{Copy, Transfer};
use backend::{FRAMES_IN_FLIGHT, Generation, Result, Ticket, check_tree};
use bvh_layout::{Moving, Topology};
use geom::{Animation, StaticParts};
use shaders::Shape;
use std::sync::Arc;

/// With as many, one is free for the next tree whatever is under way. Most of the time two will do.
const RECORDS: usize = FRAMES_IN_FLIGHT + 1;

/// Levels that a record may have at most: see `Topology::from_words`.
const LEVELS: u64 = 65;

pub(crate) struct TreeBuffers {
    records: Vec<Record>,
    current: usize,
    pub(crate) leaf_nodes: Buffer,
    pub(crate) inner_nodes: Buffer,
    pub(crate) triangles: Buffer,
    pub(crate) nodes: Buffer,
    /// Partial sums of areas: see refit.wgsl.
    pub(crate) costs: Buffer,
    pub(crate) generation: Generation,
    pub(crate) shape: Shape,
    /// What making trees here takes; none before the first.
    pub(crate) build: Option<BuildBuffers>,
    /// Whether the tree in use was made here.
    pub(crate) made_here: bool,
    /// The upload that the next submission has to wait for.
    pub(crate) arriving: Option<u64>,
    record_bytes: u64,
    animation: Arc<Animation>,
}

/// A tree's record on the host and on the device.
struct Record {
    host: Buffer,
    device: Buffer,
    /// The last submission that reads it, and the upload that filled it.
    used_by: Option<Ticket>,
    filled_at: u64,
}

impl TreeBuffers {
    /// Room for every tree over the animation's live triangles.
    pub(crate) fn new(gpu: &Arc<Gpu>, animation: &Arc<Animation>) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let nodes = (2 * leaves).saturating_sub(1);
        let record = Topology::HEADER_WORDS as u64 + LEVELS + 2 * nodes.div_ceil(32) + leaves;
        // Lists of what moves come along only where that pays.
        let lists = StaticParts::pays(animation.moving_count(), animation.live_count());
        let words = record
            + if lists {
                Moving::most_words(leaves as usize) as u64
            } else {
                0
            };
        let device = |what, bytes| Buffer::new(gpu, what, bytes, Place::Device);
        Ok(Self {
            records: Vec::new(),
            current: 0,
            leaf_nodes: device("the list of leaves", leaves * 4)?,
            inner_nodes: device("the list of inner nodes", leaves * 4)?,
            triangles: device("the triangles' records", leaves * 48)?,
            nodes: device("the tree's nodes", nodes * 32)?,
            costs: device("the tree's areas", Shape::cost_bytes(leaves))?,
            generation: Generation(0),
            shape: Shape::default(),
            build: None,
            made_here: false,
            arriving: None,
            record_bytes: words * 4,
            animation: Arc::clone(animation),
        })
    }

    /// The record in use.
    ///
    /// # Panics
    /// Before the first tree was adopted.
    pub(crate) fn topology(&self) -> &Buffer {
        let record = self.records.get(self.current);
        &record.expect("a tree was adopted").device
    }

    /// Notes that `ticket`, which waited for what was arriving, may read the record in use.
    pub(crate) fn submitted(&mut self, ticket: Ticket) {
        self.arriving = None;
        if let Some(record) = self.records.get_mut(self.current) {
            record.used_by = Some(ticket);
        }
    }

    /// Sends `tree` on its way, for all that is recorded from now on.
    pub(crate) fn adopt(
        &mut self,
        gpu: &Arc<Gpu>,
        (road, frames): (&mut Transfer, &Frames),
        (tree, generation): (&Topology, Generation),
    ) -> Result<()> {
        check_tree(tree, &self.animation)?;
        let free = self.free_record(gpu, road, frames)?;
        let record = &mut self.records[free];
        record.host.write(0, tree.words());
        if let Some(moving) = tree.moving() {
            record
                .host
                .write(tree.words().len() as u64 * 4, moving.words());
        }
        let copy = Copy {
            from: &record.host,
            to: &record.device,
            to_at: 0,
            bytes: tree.bytes() as u64,
        };
        record.filled_at = road.start(copy, None)?;
        record.used_by = None;
        self.arriving = Some(record.filled_at);
        self.current = free;
        self.generation = generation;
        self.shape = Shape::of(tree);
        self.made_here = false;
        Ok(())
    }

    /// The tree that was recorded to be made here is the one in use.
    pub(crate) fn made(&mut self, generation: Generation, shape: Shape) {
        (self.generation, self.shape, self.made_here) = (generation, shape, true);
    }

    /// A record that nobody reads nor fills, made if there is none yet.
    fn free_record(&mut self, gpu: &Arc<Gpu>, road: &Transfer, frames: &Frames) -> Result<usize> {
        let others = (0..self.records.len()).filter(|&i| i != self.current);
        for i in others.clone() {
            if self.records[i].is_free(road, frames)? {
                return Ok(i);
            }
        }
        if self.records.len() < RECORDS {
            self.records.push(Record::new(gpu, self.record_bytes)?);
            return Ok(self.records.len() - 1);
        }
        // Trees adopted one after the other without a frame between.
        let first = others.min_by_key(|&i| self.records[i].filled_at);
        let first = first.expect("there are several records");
        self.records[first].wait(road, frames)?;
        Ok(first)
    }
}

impl Record {
    fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self> {
        let what = "the tree's record";
        Ok(Self {
            host: Buffer::new(gpu, what, bytes, Place::Upload)?,
            device: Buffer::new(gpu, what, bytes, Place::Device)?,
            used_by: None,
            filled_at: 0,
        })
    }

    fn is_free(&self, road: &Transfer, frames: &Frames) -> Result<bool> {
        let unread = self.used_by.map_or(Ok(true), |t| frames.is_done(t))?;
        Ok(unread && road.done.has_reached(self.filled_at)?)
    }

    fn wait(&self, road: &Transfer, frames: &Frames) -> Result<()> {
        self.used_by.map_or(Ok(()), |t| frames.wait(t))?;
        road.done.wait(self.filled_at)
    }
}
