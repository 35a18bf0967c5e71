//! The tree in use: its record twice (one in use, one arriving), its lists, records and nodes once.

use crate::buffers::{storage, write};
use crate::device::Gpu;
use backend::{Generation, Layout, Method, Result, check_tree};
use bvh_layout::{Moving, Topology};
use geom::Animation;
use shaders::rebuild::Buffers;
use shaders::work::Trace;
use shaders::{COSTS, COVERS, NODES, Shape, TreeBuffers as Room, VISIBILITY};
use std::sync::Arc;
use wgpu::Buffer;

const RECORD: &str = "the tree's record";

pub(crate) struct TreeBuffers {
    /// Two, so that a tree can arrive while frames before it still read the old one.
    records_of: [Option<Buffer>; 2],
    current: usize,
    /// Nodes and costs are as large as the trees so far asked for.
    pub(crate) buffers: Room<Buffer>,
    pub(crate) generation: Generation,
    pub(crate) shape: Shape,
    /// What making trees here takes; none before the first.
    pub(crate) build: Option<Buffers<Buffer>>,
    /// Whether the tree in use was made here.
    pub(crate) made_here: bool,
    animation: Arc<Animation>,
}

impl TreeBuffers {
    /// Room for every tree over the animation's live triangles; with layout `fast`, [`TreeBuffers::adopt`] makes more of it.
    pub(crate) fn new(gpu: &Gpu, animation: &Arc<Animation>, method: Method) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        let buffers = Room::new(method, leaves, |what, bytes| {
            gpu.within(what, bytes)?;
            storage(gpu, what, bytes)
        })?;
        Ok(Self {
            records_of: [None, None],
            current: 0,
            buffers,
            generation: Generation(0),
            shape: Shape {
                layout: method.layout,
                ..Shape::default()
            },
            build: None,
            made_here: false,
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
        match self.shape.layout {
            Layout::Bvh2 => {
                let lists = tree.moving().map_or(&[][..], Moving::words);
                self.send(gpu, &[tree.words(), lists])?;
                self.shape = Shape::of(tree);
            }
            Layout::Fast => {
                let treelets = tree.to_treelets(self.animation.static_parts());
                let shape = Shape::of_treelets(&treelets);
                self.grow(gpu, &shape)?;
                self.send(gpu, &treelets.parts())?;
                self.shape = shape;
            }
        }
        self.generation = generation;
        Ok(())
    }

    /// Makes room for nodes and costs, with some to spare for the trees to come.
    pub(crate) fn grow(&mut self, gpu: &Gpu, shape: &Shape) -> Result<()> {
        let buffers = &mut self.buffers;
        grow(gpu, &mut buffers.nodes, NODES, shape.node_rows * 16)?;
        grow(gpu, &mut buffers.costs, COSTS, shape.own_cost_bytes())
    }

    /// Makes room for what is covered and what is seen of a picture.
    pub(crate) fn grow_picture(&mut self, gpu: &Gpu, tracing: &Trace) -> Result<()> {
        let buffers = &mut self.buffers;
        grow(gpu, &mut buffers.covers, COVERS, tracing.cover_bytes)?;
        let bytes = tracing.visibility_bytes;
        grow(gpu, &mut buffers.visibility, VISIBILITY, bytes)
    }

    /// Makes a record, part by part, the current one.
    fn send(&mut self, gpu: &Gpu, parts: &[&[u32]]) -> Result<()> {
        let bytes = parts.iter().map(|p| size_of_val(*p) as u64).sum();
        gpu.within(RECORD, bytes)?;
        let spare = 1 - self.current;
        let record = match self.records_of[spare].take().filter(|r| r.size() >= bytes) {
            Some(record) => record,
            None => storage(gpu, RECORD, with_some_to_spare(bytes))?,
        };
        let mut at = 0;
        for words in parts.iter().filter(|p| !p.is_empty()) {
            write(gpu, &record, at, words)?;
            at += size_of_val(*words) as u64;
        }
        self.records_of[spare] = Some(record);
        self.current = spare;
        self.made_here = false;
        Ok(())
    }

    /// The tree that was recorded to be made here is the one in use.
    pub(crate) fn made(&mut self, generation: Generation, shape: Shape) {
        (self.generation, self.shape, self.made_here) = (generation, shape, true);
    }

    /// Bytes of device memory.
    pub(crate) fn tree_bytes(&self) -> u64 {
        let all = self.buffers.all();
        let all = all.chain(self.records_of.iter().flatten());
        all.map(Buffer::size).sum()
    }

    /// Those of room to make trees.
    pub(crate) fn scratch_bytes(&self) -> u64 {
        let build = self.build.iter().flat_map(Buffers::all);
        build.map(Buffer::size).sum()
    }

    /// Those of what is seen of a picture.
    pub(crate) fn picture_bytes(&self) -> u64 {
        self.buffers.visibility.size()
    }
}

/// A larger buffer where this one is too small. Submissions that use the old one keep it alive.
fn grow(gpu: &Gpu, buffer: &mut Buffer, what: &str, bytes: u64) -> Result<()> {
    gpu.within(what, bytes)?;
    if buffer.size() < bytes {
        *buffer = storage(gpu, what, with_some_to_spare(bytes))?;
    }
    Ok(())
}

/// Trees of one scene differ little in size.
fn with_some_to_spare(bytes: u64) -> u64 {
    bytes + bytes / 32
}
