//! Resources of one submission: command buffers, parameters, timestamps and counts.

use crate::commands::{ALL, BUILDS, COPIES, Commands, HOST, KERNELS, RAYS};
use crate::gpu::Gpu;
use crate::marks::Marks;
use crate::memory::{Buffer, BufferUse};
use crate::pages::{Bound, Pages};
use crate::pipelines::{Layouts, Pipeline};
use crate::vulkan_device::VulkanDevice;
use ash::vk;
use backend::Result;
use gpu_common::{Dispatch, Find, Finished, GpuSlot, Stage};
use shaders::{BufferName, Counts, Params};
use std::sync::Arc;

/// Resources of one submission at a time.
pub struct Slot {
    /// Recorded command buffers.
    pub commands: Commands,
    pages: Pages,
    marks: Marks,
    /// Whether kernels were recorded since the last barrier.
    launched: bool,
    counts: Buffer,
    counts_back: Buffer,
    gpu: Arc<Gpu>,
}

const COUNTS: u64 = size_of::<Counts>() as u64;

impl Slot {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            commands: Commands::new(gpu, gpu.families[0])?,
            pages: Pages::new(gpu),
            marks: Marks::new(gpu),
            launched: false,
            counts: Buffer::new(gpu, "counts", COUNTS, BufferUse::Device)?,
            counts_back: Buffer::new(gpu, "counts", COUNTS, BufferUse::Readback)?,
            gpu: Arc::clone(gpu),
        })
    }

    fn fill_counts(&self, bytes: u64) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let bytes = bytes.min(self.counts.bytes);
        // SAFETY: the command buffer is being recorded; the buffer belongs to the slot.
        unsafe { vk.cmd_fill_buffer(commands, self.counts.vk, 0, bytes, 0) };
        self.commands.barrier(COPIES, KERNELS);
    }

    fn launch(&self, pipeline: &Pipeline, set: vk::DescriptorSet, row: u32, [x, y]: [u32; 2]) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, pipeline.vk);
            let layout = pipeline.layouts.pipeline;
            vk.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[row]);
            vk.cmd_dispatch(commands, x, y, 1);
        }
    }

    /// Binds a ray tracing pipeline to parameters, a driver's tree and buffers. `find` returns the buffer for a name in
    /// the shaders.
    pub fn bind_rays<'a>(
        &mut self,
        (pipeline, layouts): (vk::Pipeline, &Layouts),
        params: &Params,
        tree: vk::AccelerationStructureKHR,
        find: impl Fn(BufferName) -> &'a Buffer,
    ) -> Result<()> {
        let row = self.pages.row(params)?;
        let what = (layouts.set, shaders::RAYS.bindings);
        let set = self.pages.set(what, row.page, find, Some(tree))?;
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let point = vk::PipelineBindPoint::RAY_TRACING_KHR;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, pipeline);
            let layout = layouts.pipeline;
            vk.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[row.offset]);
        }
        Ok(())
    }

    /// Ends the recording with a copy of the counts to the host.
    pub(crate) fn end(&mut self) -> Result<()> {
        self.commands.barrier(ALL, COPIES);
        let all = [vk::BufferCopy::default().size(COUNTS)];
        self.commands.copy([&self.counts, &self.counts_back], &all);
        self.commands.barrier(COPIES, HOST);
        self.commands.end()
    }

    /// Returns the output of the finished submission.
    pub(crate) fn finished(&self) -> Result<Finished> {
        Ok(Finished {
            counts: self.counts_back.read::<Counts>(1)[0],
            marks: self.marks.stages.clone(),
            ticks: self.marks.read()?,
        })
    }
}

impl GpuSlot<VulkanDevice> for Slot {
    const SPLITS: bool = true;

    fn begin(&mut self) -> Result<()> {
        self.launched = false;
        self.pages.reset()?;
        self.commands.reset()?;
        self.commands.begin()?;
        let all = match self.gpu.traces_rays {
            true => ALL.and(BUILDS).and(RAYS),
            false => ALL,
        };
        self.commands.barrier(all, all);
        self.fill_counts(COUNTS);
        self.marks.begin(self.commands.vk())
    }

    /// Records a barrier before each kernel, unless the kernel reads no results of the previous ones. There is no
    /// barrier after the last kernel.
    fn dispatch(
        &mut self,
        all: &[Dispatch<'_, VulkanDevice>],
        find: Find<'_, '_, Buffer>,
    ) -> Result<()> {
        let mut last: Option<Bound> = None;
        for dispatch in all {
            if self.launched && !dispatch.work.alongside {
                self.commands.barrier(KERNELS, KERNELS);
            }
            let row = self.pages.row(&dispatch.work.params)?;
            let counts = &self.counts;
            let find = |name| match name {
                BufferName::Counts => counts,
                other => find(other),
            };
            let bound = self.pages.bind(dispatch.pipeline, row, last, find)?;
            self.launch(dispatch.pipeline, bound.set, row.offset, dispatch.groups);
            (self.launched, last) = (true, Some(bound));
        }
        Ok(())
    }

    /// Makes the results of the stage's kernels visible to later work.
    fn end_stage(&mut self, stage: Stage) -> Result<()> {
        if std::mem::take(&mut self.launched) {
            self.commands.barrier(KERNELS, KERNELS);
        }
        self.marks.end(self.commands.vk(), stage)
    }

    fn clear_counts(&mut self, bytes: u64) -> Result<()> {
        self.commands.barrier(KERNELS, COPIES);
        self.fill_counts(bytes);
        Ok(())
    }

    fn split(&mut self) -> Result<()> {
        self.commands.end()?;
        self.commands.begin()
    }
}
