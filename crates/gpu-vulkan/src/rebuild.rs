//! A tree made on the device: what it takes, and how it is recorded.

use crate::VulkanBackend;
use crate::clock::Stage;
use crate::device::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::stages::Also;
use crate::transfer::{Loader, Transfer};
use crate::vulkan::Stale;
use backend::{Generation, Result};
use geom::Animation;
use shaders::rebuild::{Buffers, Plan, Room};
use shaders::{Extent, Shape};
use std::sync::Arc;

/// Room to make trees.
fn buffers(gpu: &Arc<Gpu>, road: &mut Transfer, animation: &Animation) -> Result<Buffers<Buffer>> {
    let device = |what, bytes| Buffer::new(gpu, what, bytes, BufferUse::Device);
    let made = Buffers::new(animation, device)?;
    let largest = Room::of(animation.live_count() as u32).live;
    let mut loader = Loader::new(gpu, road, largest)?;
    made.fill(animation, |data, to| loader.send(data, to))?;
    Ok(made)
}

impl VulkanBackend {
    /// Whether the tree in use was made here, of the positions at hand: it has its records and boxes.
    pub(crate) fn is_made_whole(&self) -> bool {
        let made_here = self.tree().made_here;
        let anew = made_here && self.stale < Stale::Fresh;
        assert!(!anew, "a tree made on the device is made anew");
        made_here
    }

    /// Records a tree's making: see [`shaders::rebuild`].
    pub(crate) fn make_tree(&mut self, generation: Generation) -> Result<()> {
        let animation = Arc::clone(&self.scene().animation);
        let shape = Shape::made_on_device(self.method.layout, animation.live_count() as u32);
        let tree = self.tree.as_mut().expect("a scene was loaded");
        if tree.build.is_none() {
            self.pipelines.prepare_trees(&self.gpu, self.method)?;
            tree.build = Some(buffers(&self.gpu, &mut self.upload, &animation)?);
        }
        tree.grow(&self.gpu, &self.frames, &shape)?;
        let scene = (self.scene().scale_exponent, animation.vertex_count());
        let extents = &mut self.frames.record()?.extents;
        let plan = Plan::new(self.method, scene, &shape, extents.boxes.is_some());
        extents.uncounted = Some(0);
        extents.refitted(Extent::Whole);
        self.run(Stage::Rebuild, &plan.sort, Also::default())?;
        self.run(Stage::Preprocess, &[plan.leaves], Also::clusters())?;
        self.run(Stage::Rebuild, &plan.cluster, Also::default())?;
        let tree = self.tree.as_mut().expect("a scene was loaded");
        tree.made(generation, shape);
        Ok(())
    }
}
