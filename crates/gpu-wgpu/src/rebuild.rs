//! A tree made on the device: what it takes, and how it is recorded.

use crate::WgpuBackend;
use crate::backend_impl::Stale;
use crate::buffers::{Loader, storage};
use crate::device::Gpu;
use crate::queries::Stage;
use crate::stages::Also;
use backend::{Generation, Result};
use geom::Animation;
use shaders::rebuild::{Buffers, Plan};
use shaders::{Extent, Shape};
use std::sync::Arc;
use wgpu::Buffer;

/// Room to make trees.
fn buffers(gpu: &Gpu, animation: &Animation) -> Result<Buffers<Buffer>> {
    let made = Buffers::new(animation, |what, bytes| {
        gpu.within(what, bytes)?;
        storage(gpu, what, bytes)
    })?;
    let mut loader = Loader::new(gpu);
    made.fill(animation, |data, to| loader.send(data, to))?;
    Ok(made)
}

impl WgpuBackend {
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
            tree.build = Some(buffers(&self.gpu, &animation)?);
        }
        tree.grow(&self.gpu, &shape)?;
        let scene = (self.scene().scale_exponent, animation.vertex_count());
        let extents = &mut self.frames.record(&self.gpu)?.extents;
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
