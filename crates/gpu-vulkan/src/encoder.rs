//! Encodes recordings into command buffers.

use crate::commands::{BUILDS, COPIES, Commands, HOST, KERNELS, RAYS};
use crate::descriptors::Descriptors;
use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::{Layouts, Pipeline};
use crate::timestamps::Timestamps;
use ash::vk;
use backend::Result;
use gpu_common::{BoundBuffer, Dispatch, RecordedCommand, Recording, Stage, SubmissionOutput};
use shaders::{BufferName, Counts, Params, RAYS as RAY_SHADERS};
use std::ops::Range;
use std::sync::Arc;

/// The recordings of a Vulkan device.
pub(crate) type VulkanRecording = Recording<Pipeline, vk::Buffer, NativeCommand>;

/// A function that records Vulkan commands directly. The caller must keep the resources of these commands alive until
/// the submission has finished, because the function is dropped after the call.
pub type NativeCommand = Box<dyn FnOnce(&mut RecordingEncoder) -> Result<()> + Send>;

/// Resources of one submission at a time: command buffers, parameters, timestamps and counts.
pub struct RecordingEncoder {
    /// Recorded command buffers.
    pub commands: Commands,
    descriptors: Descriptors,
    timestamps: Timestamps,
    /// Whether kernels were recorded since the last barrier.
    needs_barrier: bool,
    counts: Buffer,
    counts_readback: Buffer,
    gpu: Arc<Gpu>,
}

/// A descriptor set. It can be reused for the same kernel with the same buffers.
struct BoundSet {
    set: vk::DescriptorSet,
    kernel: &'static str,
    /// Range of the recording's buffers.
    buffers: Range<usize>,
}

/// A ray tracing pipeline with its resources.
pub struct RayBindings<'a> {
    /// The pipeline.
    pub pipeline: vk::Pipeline,
    /// Layouts of the pipeline.
    pub layouts: &'a Layouts,
    /// Parameters of the shaders.
    pub params: &'a Params,
    /// The acceleration structure.
    pub tree: vk::AccelerationStructureKHR,
    /// One buffer for each binding of [`shaders::RAYS`], in order. The buffer for parameters is ignored.
    pub buffers: &'a [vk::Buffer],
}

const COUNTS: u64 = size_of::<Counts>() as u64;

impl RecordingEncoder {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Ok(Self {
            commands: Commands::new(gpu, gpu.families[0])?,
            descriptors: Descriptors::new(gpu, 0)?,
            timestamps: Timestamps::new(gpu, 0)?,
            needs_barrier: false,
            counts: Buffer::new(gpu, "counts", COUNTS, BufferUse::Device)?,
            counts_readback: Buffer::new(gpu, "counts", COUNTS, BufferUse::Readback)?,
            gpu: Arc::clone(gpu),
        })
    }

    /// Encodes all commands of a recording, and a copy of the counts to the host. The submission that used this encoder
    /// last must have finished.
    pub(crate) fn encode(&mut self, recording: &mut VulkanRecording) -> Result<()> {
        self.begin(recording)?;
        let mut last = None;
        for command in std::mem::take(&mut recording.commands) {
            match command {
                RecordedCommand::Dispatch(dispatch) => {
                    last = Some(self.dispatch(recording, &dispatch, last)?);
                }
                RecordedCommand::EndStage(stage) => self.end_stage(stage),
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
        self.end()
    }

    fn begin(&mut self, recording: &VulkanRecording) -> Result<()> {
        let (mut dispatches, mut stages) = (0, 0);
        for command in &recording.commands {
            match command {
                // A native command binds at most one set.
                RecordedCommand::Dispatch(_) | RecordedCommand::Native(_) => dispatches += 1,
                RecordedCommand::EndStage(_) => stages += 1,
                RecordedCommand::ClearCounts(_) | RecordedCommand::Split => (),
            }
        }
        self.needs_barrier = false;
        self.descriptors.reset(dispatches)?;
        self.commands.reset()?;
        self.commands.begin()?;
        let all = if self.gpu.features.traces_rays {
            KERNELS | COPIES | BUILDS | RAYS
        } else {
            KERNELS | COPIES
        };
        self.commands.barrier(all, all);
        self.fill_counts(COUNTS);
        self.timestamps.begin(self.commands.vk(), stages)
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
        if self.needs_barrier && !dispatch.work.alongside {
            self.commands.barrier(KERNELS, KERNELS);
        }
        let offset = self.descriptors.write(&dispatch.work.params);
        let kernel = dispatch.work.kernel.name;
        let is_same = |last: &BoundSet| {
            last.kernel == kernel
                && recording.buffers[last.buffers.clone()] == *recording.buffers_of(dispatch)
        };
        let bound = match last.filter(is_same) {
            Some(last) => last,
            None => {
                let resolve = |bound: &BoundBuffer<vk::Buffer>| match *bound {
                    BoundBuffer::Params => self.descriptors.params.vk,
                    BoundBuffer::Counts => self.counts.vk,
                    BoundBuffer::Recorded(buffer) => buffer,
                };
                let buffers = recording.buffers_of(dispatch).iter().map(resolve);
                let bindings = dispatch.work.kernel.bindings.iter().zip(buffers);
                let layout = dispatch.pipeline.layouts.set;
                BoundSet {
                    set: self.descriptors.set(layout, bindings, None)?,
                    kernel,
                    buffers: dispatch.buffers.clone(),
                }
            }
        };
        self.launch(dispatch, bound.set, offset);
        self.needs_barrier = true;
        Ok(bound)
    }

    fn launch(&self, dispatch: &Dispatch<Pipeline>, set: vk::DescriptorSet, offset: u32) {
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let (pipeline, [x, y]) = (&dispatch.pipeline, dispatch.groups);
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, pipeline.vk);
            let layout = pipeline.layouts.pipeline;
            vk.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[offset]);
            vk.cmd_dispatch(commands, x, y, 1);
        }
    }

    /// Makes the results of the stage's kernels visible to later work, and takes a timestamp.
    fn end_stage(&mut self, stage: Stage) {
        if std::mem::take(&mut self.needs_barrier) {
            self.commands.barrier(KERNELS, KERNELS);
        }
        self.timestamps.end(self.commands.vk(), stage);
    }

    /// Binds a ray tracing pipeline. A native command calls this at most once.
    pub fn bind_rays(&mut self, rays: &RayBindings<'_>) -> Result<()> {
        let offset = self.descriptors.write(rays.params);
        let params = self.descriptors.params.vk;
        let bindings = RAY_SHADERS.bindings.iter().zip(rays.buffers);
        let bindings = bindings.map(|(binding, &buffer)| match binding.name {
            BufferName::Params => (binding, params),
            _ => (binding, buffer),
        });
        let (set, layout) = (rays.layouts.set, rays.layouts.pipeline);
        let set = self.descriptors.set(set, bindings, Some(rays.tree))?;
        let (vk, commands) = (&self.gpu.vk, self.commands.vk());
        let point = vk::PipelineBindPoint::RAY_TRACING_KHR;
        // SAFETY: the command buffer is being recorded; pipeline and set belong to the device and match.
        unsafe {
            vk.cmd_bind_pipeline(commands, point, rays.pipeline);
            vk.cmd_bind_descriptor_sets(commands, point, layout, 0, &[set], &[offset]);
        }
        Ok(())
    }

    /// Ends the recording with a copy of the counts to the host.
    fn end(&mut self) -> Result<()> {
        self.commands.barrier(KERNELS | COPIES, COPIES);
        let all = [vk::BufferCopy::default().size(COUNTS)];
        let (from, to) = (self.counts.vk, self.counts_readback.vk);
        self.commands.copy(from, to, &all);
        self.commands.barrier(COPIES, HOST);
        self.commands.end()
    }

    /// Returns the output of the finished submission.
    pub(crate) fn finished(&self) -> Result<SubmissionOutput> {
        Ok(SubmissionOutput {
            counts: self.counts_readback.read::<Counts>(1)[0],
            marks: self.timestamps.stages.clone(),
            ticks: self.timestamps.read()?,
        })
    }
}
