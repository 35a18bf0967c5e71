//! The tree in use: its record twice (one in use, one arriving), its lists, records and nodes once.

use crate::buffers::{storage, write};
use crate::device::Gpu;
use crate::rebuild::BuildBuffers;
use backend::{Generation, Result, check_tree};
use bvh_layout::Topology;
use geom::Animation;
use shaders::Shape;
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
    /// Partial sums of areas: see refit.wgsl.
    pub(crate) costs: Buffer,
    pub(crate) generation: Generation,
    pub(crate) shape: Shape,
    /// What making trees here takes; none before the first.
    pub(crate) build: Option<BuildBuffers>,
    /// Whether the tree in use was made here.
    pub(crate) made_here: bool,
    animation: Arc<Animation>,
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
            costs: storage(gpu, "the tree's areas", Shape::cost_bytes(leaves))?,
            generation: Generation(0),
            shape: Shape::default(),
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
        let bytes = tree.bytes() as u64;
        gpu.within("the tree's record", bytes)?;
        let spare = 1 - self.current;
        let record = match self.records_of[spare].take().filter(|r| r.size() >= bytes) {
            Some(record) => record,
            None => storage(gpu, "the tree's record", bytes)?,
        };
        write(gpu, &record, 0, tree.words())?;
        if let Some(moving) = tree.moving() {
            write(gpu, &record, tree.words().len() as u64 * 4, moving.words())?;
        }
        self.records_of[spare] = Some(record);
        self.current = spare;
        self.generation = generation;
        self.shape = Shape::of(tree);
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
        let all = lists.into_iter().chain([&self.nodes, &self.costs]);
        let all = all.chain(self.records_of.iter().flatten());
        let build = self.build.as_ref().map_or(0, BuildBuffers::bytes);
        all.map(Buffer::size).sum::<u64>() + build
    }
}
