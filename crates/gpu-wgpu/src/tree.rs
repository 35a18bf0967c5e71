//! The tree in use: its record twice (one in use, one arriving), its lists, records and nodes once.

use crate::buffers::{storage, write};
use crate::device::Gpu;
use backend::{Generation, Layout, Method, Result, check_tree};
use bvh_layout::{Moving, MovingTreelets, Topology};
use geom::Animation;
use shaders::Shape;
use shaders::rebuild::Buffers;
use std::sync::Arc;
use wgpu::Buffer;

const RECORD: &str = "the tree's record";
const NODES: &str = "the tree's nodes";
const COSTS: &str = "the tree's areas";

pub(crate) struct TreeBuffers {
    /// Two, so that a tree can arrive while frames before it still read the old one.
    records_of: [Option<Buffer>; 2],
    current: usize,
    /// Empty with layout `fast`, as is the other list.
    pub(crate) leaf_nodes: Buffer,
    pub(crate) inner_nodes: Buffer,
    /// Three vertices a leaf with layout `fast`, else empty.
    pub(crate) leaf_corners: Buffer,
    pub(crate) triangles: Buffer,
    /// With layout `fast` as large as the trees so far asked for, as is `costs`.
    pub(crate) nodes: Buffer,
    /// Partial sums of areas: see refit.wgsl.
    pub(crate) costs: Buffer,
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
        let layout = method.layout;
        let records = shaders::record_bytes(method.intersector, leaves);
        let (list_bytes, corner_bytes, node_bytes, cost_bytes) = match layout {
            Layout::Bvh2 => (
                leaves * 4,
                0,
                (2 * leaves).saturating_sub(1) * 32,
                Shape::cost_bytes(leaves),
            ),
            Layout::Fast => (0, leaves * 12, 0, 0),
        };
        gpu.within(NODES, node_bytes)?;
        gpu.within("the triangles' records", records)?;
        Ok(Self {
            records_of: [None, None],
            current: 0,
            leaf_nodes: storage(gpu, "the list of leaves", list_bytes)?,
            inner_nodes: storage(gpu, "the list of inner nodes", list_bytes)?,
            leaf_corners: storage(gpu, "the leaves' vertices", corner_bytes)?,
            triangles: storage(gpu, "the triangles' records", records)?,
            nodes: storage(gpu, NODES, node_bytes)?,
            costs: storage(gpu, COSTS, cost_bytes)?,
            generation: Generation(0),
            shape: Shape {
                layout,
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
                let lists = treelets.moving().map_or(&[][..], MovingTreelets::words);
                let shape = Shape::of_treelets(&treelets);
                self.grow(gpu, &shape)?;
                self.send(gpu, &[treelets.words(), lists])?;
                self.shape = shape;
            }
        }
        self.generation = generation;
        Ok(())
    }

    /// Makes room for nodes and costs, with some to spare for the trees to come.
    pub(crate) fn grow(&mut self, gpu: &Gpu, shape: &Shape) -> Result<()> {
        grow(gpu, &mut self.nodes, NODES, shape.node_rows * 16)?;
        grow(gpu, &mut self.costs, COSTS, shape.own_cost_bytes())
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
    pub(crate) fn bytes(&self) -> u64 {
        let lists = [&self.leaf_nodes, &self.inner_nodes, &self.triangles];
        let all = lists.into_iter().chain([&self.leaf_corners]);
        let all = all.chain([&self.nodes, &self.costs]);
        let all = all.chain(self.records_of.iter().flatten());
        let build = self.build.iter().flat_map(Buffers::all);
        all.chain(build).map(Buffer::size).sum()
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
