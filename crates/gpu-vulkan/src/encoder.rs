//! Encodes recordings into command buffers.

use crate::commands::{ALL, BUILDS, COPIES, Commands, HOST, KERNELS, RAYS};
use crate::gpu::Gpu;
use crate::marks::Timestamps;
use crate::memory::{Buffer, BufferRange, BufferUse};
use crate::pages::Pages;
use crate::pipelines::{Layouts, Pipeline};
use ash::vk;
use backend::Result;
use gpu_common::{BoundBuffer, Dispatch, RecordedCommand, Recording, Stage, SubmissionOutput};
use shaders::{BufferName, Counts, Params};
use std::ops::Range;
use std::sync::Arc;

/// The recordings of a Vulkan device.
pub(crate) type VulkanRecording = Recording<Pipeline, BufferRange, NativeCommand>;

/// A function that records Vulkan's own commands. It keeps its resources alive only until it was called.
pub type NativeCommand = Box<dyn FnOnce(&mut RecordingEncoder) -> Result<()> + Send>;

/// Resources of one submission at a time: command buffers, parameters, timestamps and counts.
pub struct RecordingEncoder {
    /// Recorded command buffers.
    pub commands: Commands,
    pages: Pages,
    marks: Timestamps,
    /// Whether kernels were recorded since the last barrier.
    launched: bool,
    counts: Buffer,
    counts_back: Buffer,
    gpu: Arc<Gpu>,
}

/// A descriptor set. It can be reused for the same kernel with the same buffers and parameters of the same page.
struct BoundSet {
    set: vk::DescriptorSet,
    kernel: &'static str,
    page: usize,
    /// Range of the recording's buffers.
    buffers: Range<usize>,
}

const COUNTS: u64 = size_of::<Counts>() as u64;

impl RecordingEncoder {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            commands: Commands::new(gpu, gpu.families[0])?,
            pages: Pages::new(gpu),
            marks: Timestamps::new(gpu),
            launched: false,
            counts: Buffer::new(gpu, "counts", COUNTS, BufferUse::Device)?,
            counts_back: Buffer::new(gpu, "counts", COUNTS, BufferUse::Readback)?,
            gpu: Arc::clone(gpu),
        })
    }

    /// Encodes all commands of a recording, and a copy of the counts to the host. The previous submission must have
    /// finished.
    pub(crate) fn encode(&mut self, recording: &mut VulkanRecording) -> Result<()> {
        self.begin()?;
        let mut commands = std::mem::take(&mut recording.commands);
        let mut last = None;
        for command in commands.drain(..) {
            match command {
                RecordedCommand::Dispatch(dispatch) => {
                    last = Some(self.dispatch(recording, &dispatch, last)?);
                }
                RecordedCommand::EndStage(stage) => self.end_stage(stage)?,
                RecordedCommand::ClearCounts(bytes) => {
                    self.commands.barrier(KERNELS, COPIES);
                    self.fill_counts(bytes);
                }
                RecordedCommand::Split => {
                    self.commands.end()?;
                    self.commands.begin()?;
                }
                RecordedCommand::Native(record) => record(self)?,
            }
        }
        // The vector keeps its capacity.
        recording.commands = commands;
        self.end()
    }

    fn begin(&mut self) -> Result<()> {
        self.launched = false;
        self.pages.reset()?;
        self.commands.reset()?;
        self.commands.begin()?;
        let all = if self.gpu.traces_rays {
            ALL.and(BUILDS).and(RAYS)
        } else {
            ALL
        };
        self.commands.barrier(all, all);
        self.fill_counts(COUNTS);
        self.marks.begin(self.commands.vk())
    }

    fn fill_counts(&self, bytes: u64) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let bytes = bytes.min(self.counts.bytes);
        // SAFETY: the command buffer is being recorded; the buffer belongs to the encoder.
        unsafe { vk.cmd_fill_buffer(commands, self.counts.vk, 0, bytes, 0) };
        self.commands.barrier(COPIES, KERNELS);
    }

    /// Encodes a barrier and a kernel. The barrier is left out if the kernel reads no results of the previous ones.
    fn dispatch(
        &mut self,
        recording: &VulkanRecording,
        dispatch: &Dispatch<Pipeline>,
        last: Option<BoundSet>,
    ) -> Result<BoundSet> {
        if self.launched && !dispatch.work.alongside {
            self.commands.barrier(KERNELS, KERNELS);
        }
        let row = self.pages.row(&dispatch.work.params)?;
        let (kernel, page) = (dispatch.work.kernel.name, row.page);
        let is_same = |last: &BoundSet| {
            (last.kernel, last.page) == (kernel, page)
                && recording.buffers[last.buffers.clone()] == *recording.buffers_of(dispatch)
        };
        let bound = match last.filter(is_same) {
            Some(last) => last,
            None => {
                let params = self.pages.params(page);
                let resolve = |bound: BoundBuffer<&BufferRange>| match bound {
                    BoundBuffer::Params => params,
                    BoundBuffer::Counts => self.counts.range(),
                    BoundBuffer::Recorded(buffer) => *buffer,
                };
                let bindings = recording.bindings_of(dispatch);
                let bindings = bindings.map(|(binding, bound)| (binding, resolve(bound)));
                let layout = dispatch.pipeline.layouts.set;
                BoundSet {
                    set: self.pages.set(layout, page, bindings, None)?,
                    kernel,
                    page,
                    buffers: dispatch.buffers.clone(),
                }
            }
        };
        self.launch(dispatch, bound.set, row.offset);
        self.launched = true;
        Ok(bound)
    }

    fn launch(&self, dispatch: &Dispatch<Pipeline>, set: vk::DescriptorSet, row: u32) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let (pipeline, [x, y]) = (&dispatch.pipeline, dispatch.groups);
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, pipeline.vk);
            let layout = pipeline.layouts.pipeline;
            vk.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[row]);
            vk.cmd_dispatch(commands, x, y, 1);
        }
    }

    /// Makes the results of the stage's kernels visible to later work, and takes a timestamp.
    fn end_stage(&mut self, stage: Stage) -> Result<()> {
        if std::mem::take(&mut self.launched) {
            self.commands.barrier(KERNELS, KERNELS);
        }
        self.marks.end(self.commands.vk(), stage)
    }

    /// Binds a ray tracing pipeline to parameters, a driver's tree and buffers. `find` returns the buffer for a name in
    /// the shaders.
    pub fn bind_rays(
        &mut self,
        pipeline: vk::Pipeline,
        layouts: &Layouts,
        params: &Params,
        tree: vk::AccelerationStructureKHR,
        find: impl Fn(BufferName) -> BufferRange,
    ) -> Result<()> {
        let row = self.pages.row(params)?;
        let of_params = self.pages.params(row.page);
        let buffer = |name| {
            if name == BufferName::Params {
                of_params
            } else {
                find(name)
            }
        };
        let bindings = shaders::RAYS.bindings.iter();
        let bindings = bindings.map(|binding| (binding, buffer(binding.name)));
        let set = self
            .pages
            .set(layouts.set, row.page, bindings, Some(tree))?;
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
    fn end(&mut self) -> Result<()> {
        self.commands.barrier(ALL, COPIES);
        let all = [vk::BufferCopy::default().size(COUNTS)];
        let buffers = [&self.counts, &self.counts_back].map(|buffer| buffer.vk);
        self.commands.copy(buffers, &all);
        self.commands.barrier(COPIES, HOST);
        self.commands.end()
    }

    /// Returns the output of the finished submission.
    pub(crate) fn finished(&self) -> Result<SubmissionOutput> {
        Ok(SubmissionOutput {
            counts: self.counts_back.read::<Counts>(1)[0],
            marks: self.marks.stages.clone(),
            ticks: self.marks.read()?,
        })
    }
}
