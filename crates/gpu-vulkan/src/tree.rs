//! The tree in use: records of it and of those arriving, its lists, records of triangles and nodes once.

use crate::device::Gpu;
use crate::frames::Frames;
use crate::memory::{Buffer, BufferUse};
use crate::transfer::{Copy, Transfer};
use backend::{FRAMES_IN_FLIGHT, Generation, Layout, Method, Result, Ticket, check_tree};
use bvh_layout::{Moving, Topology};
use geom::Animation;
use shaders::rebuild::Buffers;
use shaders::work::Trace;
use shaders::{COSTS, COVERS, NODES, Shape, TreeBuffers as Room, VISIBILITY};
use std::sync::Arc;

/// With as many, one is free for the next tree whatever is under way. Most of the time two will do.
const RECORDS: usize = FRAMES_IN_FLIGHT + 1;

pub(crate) struct TreeBuffers {
    records: Vec<Record>,
    current: usize,
    /// Nodes and costs are as large as the trees so far asked for.
    pub(crate) buffers: Room<Buffer>,
    /// Buffers that were too small, with the last submission that may use them.
    outgrown: Vec<(Ticket, Buffer)>,
    pub(crate) generation: Generation,
    pub(crate) shape: Shape,
    /// What making trees here takes; none before the first.
    pub(crate) build: Option<Buffers<Buffer>>,
    /// Whether the tree in use was made here.
    pub(crate) made_here: bool,
    /// The upload that the next submission has to wait for.
    pub(crate) arriving: Option<u64>,
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
    /// Room for every tree over the animation's live triangles; with layout `fast`, [`TreeBuffers::adopt`] makes more of it.
    pub(crate) fn new(gpu: &Arc<Gpu>, animation: &Arc<Animation>, method: Method) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let buffers = Room::new(method, leaves, |what, bytes| {
            Buffer::new(gpu, what, bytes, BufferUse::Device)
        })?;
        Ok(Self {
            records: Vec::new(),
            current: 0,
            buffers,
            outgrown: Vec::new(),
            generation: Generation(0),
            shape: Shape {
                layout: method.layout,
                ..Shape::default()
            },
            build: None,
            made_here: false,
            arriving: None,
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

    /// Bytes of device memory, and of room to bring or to make the next tree.
    pub(crate) fn held(&self) -> [u64; 2] {
        let records = self.records.iter().map(|r| &r.device);
        let staged = self.records.iter().map(|r| &r.host);
        let outgrown = self.outgrown.iter().map(|(_, buffer)| buffer);
        let build = self.build.iter().flat_map(Buffers::all);
        let tree = self.buffers.all().chain(records).map(Buffer::held).sum();
        let scratch = staged.chain(outgrown).chain(build).map(Buffer::held).sum();
        [tree, scratch]
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
        match self.shape.layout {
            Layout::Bvh2 => {
                let lists = tree.moving().map_or(&[][..], Moving::words);
                self.send(gpu, (road, frames), &[tree.words(), lists])?;
                self.shape = Shape::of(tree);
            }
            Layout::Fast => {
                let treelets = tree.to_treelets(self.animation.static_parts());
                let shape = Shape::of_treelets(&treelets);
                self.grow(gpu, frames, &shape)?;
                self.send(gpu, (road, frames), &treelets.parts())?;
                self.shape = shape;
            }
        }
        self.generation = generation;
        Ok(())
    }

    /// Makes room for nodes and costs, with some to spare for the trees to come.
    pub(crate) fn grow(&mut self, gpu: &Arc<Gpu>, frames: &Frames, shape: &Shape) -> Result<()> {
        let mut kept = Vec::new();
        for (ticket, buffer) in self.outgrown.drain(..) {
            if !frames.is_done(ticket)? {
                kept.push((ticket, buffer));
            }
        }
        self.outgrown = kept;
        let [nodes, costs] = [shape.node_rows * 16, shape.own_cost_bytes()];
        self.enlarge(gpu, frames, |b| &mut b.nodes, (NODES, nodes))?;
        self.enlarge(gpu, frames, |b| &mut b.costs, (COSTS, costs))
    }

    /// Makes room for what is covered and what is seen of a picture.
    pub(crate) fn grow_picture(
        &mut self,
        gpu: &Arc<Gpu>,
        frames: &Frames,
        tracing: &Trace,
    ) -> Result<()> {
        let covers = (COVERS, tracing.cover_bytes);
        self.enlarge(gpu, frames, |b| &mut b.covers, covers)?;
        let visibility = (VISIBILITY, tracing.visibility_bytes);
        self.enlarge(gpu, frames, |b| &mut b.visibility, visibility)
    }

    /// Puts a larger buffer, with some to spare, in the place of one that is too small.
    fn enlarge(
        &mut self,
        gpu: &Arc<Gpu>,
        frames: &Frames,
        which: fn(&mut Room<Buffer>) -> &mut Buffer,
        (what, bytes): (&'static str, u64),
    ) -> Result<()> {
        let buffer = which(&mut self.buffers);
        if buffer.bytes < bytes {
            let larger = Buffer::new(gpu, what, bytes + bytes / 32, BufferUse::Device)?;
            let old = std::mem::replace(buffer, larger);
            self.outgrown.push((frames.next(), old));
        }
        Ok(())
    }

    /// Sends a record, part by part, on its way and makes it the current one.
    fn send(
        &mut self,
        gpu: &Arc<Gpu>,
        (road, frames): (&mut Transfer, &Frames),
        parts: &[&[u32]],
    ) -> Result<()> {
        let bytes = parts.iter().map(|p| size_of_val(*p) as u64).sum();
        let free = self.free_record(gpu, (road, frames), bytes)?;
        let record = &mut self.records[free];
        let mut at = 0;
        for words in parts {
            record.host.write(at, words);
            at += size_of_val(*words) as u64;
        }
        let copy = Copy {
            from: &record.host,
            to: &record.device,
            to_at: 0,
            bytes,
        };
        record.filled_at = road.start(copy, None)?;
        record.used_by = None;
        self.arriving = Some(record.filled_at);
        self.current = free;
        self.made_here = false;
        Ok(())
    }

    /// The tree that was recorded to be made here is the one in use.
    pub(crate) fn made(&mut self, generation: Generation, shape: Shape) {
        (self.generation, self.shape, self.made_here) = (generation, shape, true);
    }

    /// A record of so many bytes that nobody reads nor fills.
    fn free_record(
        &mut self,
        gpu: &Arc<Gpu>,
        (road, frames): (&Transfer, &Frames),
        bytes: u64,
    ) -> Result<usize> {
        let free = self.unused_record(gpu, (road, frames), bytes)?;
        if self.records[free].device.bytes < bytes {
            self.records[free] = Record::new(gpu, bytes)?;
        }
        Ok(free)
    }

    /// A record that nobody reads nor fills, made if there is none yet.
    fn unused_record(
        &mut self,
        gpu: &Arc<Gpu>,
        (road, frames): (&Transfer, &Frames),
        bytes: u64,
    ) -> Result<usize> {
        let others = (0..self.records.len()).filter(|&i| i != self.current);
        for i in others.clone() {
            if self.records[i].is_free(road, frames)? {
                return Ok(i);
            }
        }
        if self.records.len() < RECORDS {
            self.records.push(Record::new(gpu, bytes)?);
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
    /// Somewhat larger than asked for: records of one scene differ little.
    fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self> {
        let (what, bytes) = ("the tree's record", bytes + bytes / 32);
        Ok(Self {
            host: Buffer::new(gpu, what, bytes, BufferUse::Staging)?,
            device: Buffer::new(gpu, what, bytes, BufferUse::Device)?,
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
