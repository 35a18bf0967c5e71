//! The tree in use: buffers of its nodes and records, and how it came to be.

use crate::{BufferTable, GpuDevice, Sent};
use backend::{Generation, Layout, Method, Result, check_tree};
use bvh_layout::{Moving, Topology};
use geom::Animation;
use shaders::work::Trace;
use shaders::{BufferName, Shape, rebuild, tree_buffers};

pub(crate) struct TreeBuffers<D: GpuDevice> {
    /// As the host sent it; none before the first.
    record: Option<D::Buffer>,
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
    pub(crate) fn new(gpu: &D, animation: &Animation, method: Method) -> Result<Self> {
        let leaves = animation.live_count() as u64;
        Ok(Self {
            record: None,
            buffers: BufferTable::new(gpu, tree_buffers(method, leaves))?,
            build: None,
            generation: Generation(0),
            shape: Shape {
                layout: method.layout,
                ..Shape::default()
            },
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

    /// Sends `tree` on its way, for all that is recorded from now on.
    pub(crate) fn adopt(
        &mut self,
        gpu: &mut D,
        animation: &Animation,
        (tree, generation): (&Topology, Generation),
    ) -> Result<()> {
        check_tree(tree, animation)?;
        let ((record, arrival), shape) = match self.shape.layout {
            Layout::Bvh2 => {
                let lists = tree.moving().map_or(&[][..], Moving::words);
                (
                    gpu.send(Sent::Tree, &[tree.words(), lists])?,
                    Shape::of(tree),
                )
            }
            Layout::Fast => {
                let treelets = tree.to_treelets(animation.static_parts());
                let shape = Shape::of_treelets(&treelets);
                self.grow(gpu, &shape)?;
                (gpu.send(Sent::Tree, &treelets.parts())?, shape)
            }
        };
        gpu.expect(arrival);
        if let Some(old) = self.record.replace(record) {
            gpu.recycle(Sent::Tree, old, 0);
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
    pub(crate) fn make_build(&mut self, gpu: &mut D, animation: &Animation) -> Result<()> {
        let build = BufferTable::new(gpu, rebuild::buffers(animation))?;
        let contents = rebuild::contents(animation);
        let all = contents.iter().map(|(name, words)| -> (&[u8], _) {
            let buffer = build.get(*name).expect("made just now");
            (bytemuck::cast_slice(words), buffer)
        });
        gpu.upload(&all.collect::<Vec<_>>())?;
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
