//! The tree in use: buffers of its nodes and records, and how it came to be.

use crate::{BufferTable, GpuDevice, LastUse, Pool, with_slack};
use backend::{BackendError, Generation, Layout, Method, Result, Ticket, TreeWriter, check_tree};
use bvh_layout::Topology;
use geom::{Animation, lock};
use shaders::work::Trace;
use shaders::{BufferName, Shape, rebuild, tree_buffers};
use std::sync::{Arc, Mutex};

pub(crate) struct TreeBuffers<D: GpuDevice> {
    animation: Arc<Animation>,
    /// As the host sent it, with its number to be expected; none before the first.
    record: Option<(D::Buffer, u64)>,
    /// Records that are not in use.
    free: Pool<D>,
    /// Bytes of what was sent last; 0 before.
    last_bytes: u64,
    /// The tree to come, likewise.
    sent: Option<(Generation, D::Buffer, u64)>,
    /// The next tree, written by whoever built it.
    written: Arc<Mutex<Option<Written<D::Buffer>>>>,
    /// Nodes and costs are as large as the trees so far asked for.
    pub(crate) buffers: BufferTable<D>,
    /// What making trees here takes; none before the first.
    pub(crate) build: Option<BufferTable<D>>,
    pub(crate) generation: Generation,
    pub(crate) shape: Shape,
    /// Whether the tree in use was made here.
    pub(crate) made_here: bool,
}

impl<D: GpuDevice> TreeBuffers<D> {
    /// Room for every tree over the animation's live triangles; with layout `fast`, [`TreeBuffers::adopt`] makes more of it.
    pub(crate) fn new(gpu: &D, animation: &Arc<Animation>, method: Method) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        Ok(Self {
            animation: Arc::clone(animation),
            record: None,
            free: Pool::default(),
            last_bytes: 0,
            sent: None,
            written: Arc::default(),
            buffers: BufferTable::new(gpu, tree_buffers(method, leaves))?,
            build: None,
            generation: Generation(0),
            shape: Shape::none(method.layout),
            made_here: false,
        })
    }

    pub(crate) fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        match name {
            BufferName::Topology => self.record.as_ref().map(|(record, _)| record),
            _ => {
                let build = || self.build.as_ref().and_then(|b| b.get(name));
                self.buffers.get(name).or_else(build)
            }
        }
    }

    /// What writes the tree of that generation where it can be sent from.
    pub(crate) fn writer(
        &mut self,
        gpu: &mut D,
        generation: Generation,
    ) -> Result<Option<TreeWriter>> {
        // What was written and never sent is of no use any more.
        let spare = lock(&self.written).take();
        let mut staging = match spare {
            Some(spare) => spare.staging,
            None if self.last_bytes == 0 => return Ok(None),
            None => gpu.staging(self.last_bytes)?,
        };
        let (to, layout) = (Arc::clone(&self.written), self.shape.layout);
        let animation = Arc::clone(&self.animation);
        Ok(Some(Box::new(move |tree| {
            with_parts(layout, tree, &animation, |parts| {
                // Too little memory is dropped: the next tree gets other.
                if D::fill(&mut staging, parts) {
                    *lock(&to) = Some(Written {
                        staging,
                        bytes: bytes(parts),
                        generation,
                    });
                }
            });
        })))
    }

    /// Sends a tree on its way, if it was not; the number to be expected.
    pub(crate) fn send(
        &mut self,
        gpu: &mut D,
        (tree, generation): (&Topology, Generation),
    ) -> Result<u64> {
        let (buffer, arrival) = match self.sent.take() {
            Some((of, buffer, arrival)) if of == generation => (buffer, arrival),
            left => {
                if let Some((_, buffer, arrival)) = left {
                    self.free.put(buffer, LastUse { arrival, ticket: 0 });
                }
                let (staging, bytes) = self.staged(gpu, (tree, generation))?;
                let (buffer, _) = self.free.fit(
                    bytes,
                    |last, may_wait| gpu.has_ended(last, may_wait),
                    || with_slack(bytes, |bytes| gpu.room(BufferName::Topology.name(), bytes)),
                )?;
                self.last_bytes = bytes;
                let arrival = gpu.send(staging, bytes, &buffer)?;
                (buffer, arrival)
            }
        };
        self.sent = Some((generation, buffer, arrival));
        Ok(arrival)
    }

    /// A tree where it is sent from, and its bytes.
    fn staged(
        &self,
        gpu: &mut D,
        (tree, generation): (&Topology, Generation),
    ) -> Result<(D::Buffer, u64)> {
        let written = lock(&self.written).take();
        if let Some(written) = written.filter(|written| written.generation == generation) {
            return Ok((written.staging, written.bytes));
        }
        with_parts(self.shape.layout, tree, &self.animation, |parts| {
            let mut staging = gpu.staging(bytes(parts))?;
            match D::fill(&mut staging, parts) {
                true => Ok((staging, bytes(parts))),
                false => Err(BackendError::DeviceLost("nothing can be written".into())),
            }
        })
    }

    /// Makes `tree` current for all that is recorded from now on, after the last submission.
    pub(crate) fn adopt(
        &mut self,
        gpu: &mut D,
        (tree, generation): (&Topology, Generation),
        last: Ticket,
    ) -> Result<()> {
        let animation = &self.animation;
        check_tree(tree, animation)?;
        let shape = match self.shape.layout {
            Layout::Bvh2 => Shape::of(tree),
            Layout::Fast => Shape::of_treelets(&tree.to_treelets(animation.static_parts())),
        };
        self.grow(gpu, &shape)?;
        self.send(gpu, (tree, generation))?;
        if let Some((_, record, arrival)) = self.sent.take() {
            gpu.expect(arrival);
            if let Some((old, arrival)) = self.record.replace((record, arrival)) {
                let ticket = last.0;
                self.free.put(old, LastUse { arrival, ticket });
            }
        }
        self.shape = shape;
        (self.generation, self.made_here) = (generation, false);
        Ok(())
    }

    /// Makes room for nodes and costs.
    pub(crate) fn grow(&mut self, gpu: &mut D, shape: &Shape) -> Result<()> {
        let nodes = shape.node_rows * 16;
        self.buffers.grow(gpu, BufferName::Nodes, nodes)?;
        let costs = shape.own_cost_bytes();
        self.buffers.grow(gpu, BufferName::Costs, costs)
    }

    /// Makes room for what is covered and what is seen of a picture.
    pub(crate) fn grow_picture(&mut self, gpu: &mut D, tracing: &Trace) -> Result<()> {
        let buffers = &mut self.buffers;
        buffers.grow(gpu, BufferName::Covers, tracing.cover_bytes)?;
        buffers.grow(gpu, BufferName::Visibility, tracing.visibility_bytes)
    }

    /// Makes room to make trees.
    pub(crate) fn make_build(&mut self, gpu: &mut D) -> Result<()> {
        let build = BufferTable::new(gpu, rebuild::buffers(&self.animation))?;
        let contents = rebuild::contents(&self.animation);
        let bytes = contents.iter();
        let bytes = bytes.map(|(name, words)| (*name, bytemuck::cast_slice(words)));
        build.fill(gpu, &bytes.collect::<Vec<_>>())?;
        self.build = Some(build);
        Ok(())
    }

    /// Bytes of device memory: of the tree, of room to make one, of what is seen of a picture.
    pub(crate) fn held(&self) -> [u64; 3] {
        let picture = self.buffers.get(BufferName::Visibility);
        let picture = picture.map_or(0, D::held);
        let build = self.build.as_ref().map_or(0, BufferTable::held);
        let record = self
            .record
            .as_ref()
            .map_or(0, |(record, _)| D::held(record));
        let tree = self.buffers.held() - picture + record + self.free.held();
        [tree, build, picture]
    }
}

/// A tree where it can be sent from.
struct Written<B> {
    staging: B,
    bytes: u64,
    generation: Generation,
}

fn bytes(parts: &[&[u32]]) -> u64 {
    parts.iter().map(|part| size_of_val(*part) as u64).sum()
}

/// What is sent of a tree, part by part.
fn with_parts<T>(
    layout: Layout,
    tree: &Topology,
    animation: &Animation,
    use_them: impl FnOnce(&[&[u32]]) -> T,
) -> T {
    match layout {
        Layout::Bvh2 => {
            let lists = tree.moving().map_or(&[][..], |moving| &moving.words);
            use_them(&[tree.words(), lists])
        }
        Layout::Fast => use_them(&tree.to_treelets(animation.static_parts()).parts()),
    }
}
