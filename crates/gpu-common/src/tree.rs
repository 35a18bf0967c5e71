//! The tree in use: buffers of its nodes and records, and how it came to be.

use crate::{BufferTable, GpuDevice, Sent};
use backend::{Generation, Layout, Method, Result, TreeWriter, check_tree};
use bvh_layout::{Moving, Topology};
use geom::Animation;
use shaders::work::Trace;
use shaders::{BufferName, Shape, rebuild, tree_buffers};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub(crate) struct TreeBuffers<D: GpuDevice> {
    animation: Arc<Animation>,
    /// As the host sent it; none before the first.
    record: Option<D::Buffer>,
    /// The tree to come, and its number to be expected.
    sent: Option<(Generation, D::Buffer, u64)>,
    /// Where the next tree can be written, to be sent from there.
    written: Arc<Mutex<Option<Written<D>>>>,
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
            BufferName::Topology => self.record.as_ref(),
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
        // Held elsewhere only while a tree is written, of which there is one at a time.
        let mut written = lock(&self.written);
        let staging = match written.take() {
            Some(spare) => Some(spare.staging),
            None => gpu.staging(Sent::Tree)?,
        };
        let Some(staging) = staging else {
            return Ok(None);
        };
        *written = Some(Written {
            staging,
            generation: Generation(0),
        });
        drop(written);
        let (to, layout) = (Arc::clone(&self.written), self.shape.layout);
        let animation = Arc::clone(&self.animation);
        Ok(Some(Box::new(move |tree| {
            with_parts(layout, tree, &animation, |parts| {
                if let Some(written) = lock(&to).as_mut()
                    && D::fill(&mut written.staging, parts)
                {
                    written.generation = generation;
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
                if let Some((_, buffer, _)) = left {
                    gpu.recycle(Sent::Tree, buffer, 0);
                }
                let written = lock(&self.written).take();
                // Memory that the tree was not written to is too small: the next one gets other.
                match written.filter(|written| written.generation == generation) {
                    Some(written) => gpu.send_filled(Sent::Tree, written.staging)?,
                    None => with_parts(self.shape.layout, tree, &self.animation, |parts| {
                        gpu.send(Sent::Tree, parts)
                    })?,
                }
            }
        };
        self.sent = Some((generation, buffer, arrival));
        Ok(arrival)
    }

    /// Makes `tree` current for all that is recorded from now on.
    pub(crate) fn adopt(
        &mut self,
        gpu: &mut D,
        (tree, generation): (&Topology, Generation),
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
            if let Some(old) = self.record.replace(record) {
                gpu.recycle(Sent::Tree, old, 0);
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
        let record = self.record.as_ref().map_or(0, D::held);
        [self.buffers.held() - picture + record, build, picture]
    }
}

/// A tree where it can be sent from.
struct Written<D: GpuDevice> {
    staging: D::Staging,
    /// The tree that is written there; 0 if none is.
    generation: Generation,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
            let lists = tree.moving().map_or(&[][..], Moving::words);
            use_them(&[tree.words(), lists])
        }
        Layout::Fast => use_them(&tree.to_treelets(animation.static_parts()).parts()),
    }
}
