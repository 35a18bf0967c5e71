//! What one submission needs for itself: commands, descriptors, parameters, queries, counts.

use crate::device::Gpu;
use crate::errors::failed;
use crate::memory::{Buffer, Place};
use ash::vk;
use backend::{FrameReport, Result, StageTimes, Ticket};
use std::sync::Arc;

/// Dispatches that one submission may hold: a few stages and one a level of the tree.
const DISPATCHES: u32 = 96;
/// Stage boundaries that one submission may mark.
const QUERIES: u32 = 16;

/// A stage of a frame, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Interpolate,
    Preprocess,
    Refit,
    TracePrimary,
    TraceShadow,
}

/// Used by one submission at a time.
pub(crate) struct Slot {
    pub(crate) commands: vk::CommandBuffer,
    /// The submission that last used the slot.
    pub(crate) ticket: Option<Ticket>,
    pub(crate) params: Buffer,
    pub(crate) params_used: u32,
    pub(crate) params_stride: u64,
    pub(crate) counts: Buffer,
    pub(crate) counts_back: Buffer,
    pub(crate) queries: vk::QueryPool,
    pub(crate) stages: Vec<Stage>,
    pub(crate) readback_bytes: u64,
    pool: vk::CommandPool,
    descriptors: vk::DescriptorPool,
    gpu: Arc<Gpu>,
}

impl Slot {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let params_stride =
            (size_of::<shaders::Params>() as u64).next_multiple_of(gpu.uniform_alignment);
        let pool = command_pool(gpu, gpu.compute.family)?;
        let commands = command_buffer(gpu, pool)?;
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(QUERIES);
        // SAFETY: the device is alive and `info` outlives the call.
        let queries =
            unsafe { gpu.vk.create_query_pool(&info, None) }.map_err(failed("queries"))?;
        Ok(Self {
            commands,
            ticket: None,
            params: Buffer::new(
                gpu,
                "parameters",
                params_stride * u64::from(DISPATCHES),
                Place::Upload,
            )?,
            params_used: 0,
            params_stride,
            counts: Buffer::new(gpu, "counts", 16, Place::Device)?,
            counts_back: Buffer::new(gpu, "counts", 16, Place::Readback)?,
            queries,
            stages: Vec::new(),
            readback_bytes: 0,
            pool,
            descriptors: descriptor_pool(gpu)?,
            gpu: Arc::clone(gpu),
        })
    }

    /// Starts a new recording. The slot's last submission must be finished.
    pub(crate) fn begin(&mut self) -> Result<()> {
        self.params_used = 0;
        self.stages.clear();
        self.readback_bytes = 0;
        self.ticket = None;
        let vk = &self.gpu.vk;
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission is finished, so neither pool is in use.
        unsafe {
            vk.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .and_then(|()| {
                    vk.reset_descriptor_pool(
                        self.descriptors,
                        vk::DescriptorPoolResetFlags::empty(),
                    )
                })
                .and_then(|()| vk.begin_command_buffer(self.commands, &info))
                .map_err(failed("recording"))?;
            vk.cmd_reset_query_pool(self.commands, self.queries, 0, QUERIES);
            vk.cmd_fill_buffer(self.commands, self.counts.vk, 0, vk::WHOLE_SIZE, 0);
        }
        self.barrier();
        self.mark();
        Ok(())
    }

    /// Everything recorded so far, here or in earlier submissions, comes before what follows.
    pub(crate) fn barrier(&self) {
        let both = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        let wrote = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
        let uses = wrote | vk::AccessFlags::SHADER_READ | vk::AccessFlags::TRANSFER_READ;
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(wrote)
            .dst_access_mask(uses)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.gpu
                .vk
                .cmd_pipeline_barrier(self.commands, both, both, none, &memory, &[], &[])
        };
    }

    /// Between two dispatches.
    pub(crate) fn compute_barrier(&self) {
        let stage = vk::PipelineStageFlags::COMPUTE_SHADER;
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.gpu
                .vk
                .cmd_pipeline_barrier(self.commands, stage, stage, none, &memory, &[], &[])
        };
    }

    /// Ends a stage.
    pub(crate) fn end_stage(&mut self, stage: Stage) {
        self.stages.push(stage);
        self.mark();
    }

    fn mark(&self) {
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        let query = self.stages.len() as u32;
        // SAFETY: the command buffer is being recorded and the query was reset in it.
        unsafe {
            self.gpu
                .vk
                .cmd_write_timestamp(self.commands, stage, self.queries, query)
        };
    }

    /// Ends the recording.
    pub(crate) fn end(&mut self) -> Result<()> {
        self.barrier();
        let copy = [vk::BufferCopy::default().size(16)];
        let to_host = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let (from, to) = (
            vk::PipelineStageFlags::TRANSFER,
            vk::PipelineStageFlags::HOST,
        );
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded; both buffers belong to the slot.
        unsafe {
            self.gpu
                .vk
                .cmd_copy_buffer(self.commands, self.counts.vk, self.counts_back.vk, &copy);
            self.gpu
                .vk
                .cmd_pipeline_barrier(self.commands, from, to, none, &to_host, &[], &[]);
            self.gpu
                .vk
                .end_command_buffer(self.commands)
                .map_err(failed("recording"))
        }
    }

    /// A descriptor set for one dispatch.
    pub(crate) fn descriptor_set(
        &self,
        layout: vk::DescriptorSetLayout,
    ) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.descriptors)
            .set_layouts(&layouts);
        // SAFETY: the pool belongs to the slot and was sized for every dispatch.
        unsafe { self.gpu.vk.allocate_descriptor_sets(&info) }
            .map(|sets| sets[0])
            .map_err(failed("descriptors"))
    }

    /// What the finished submission did: inactive, degenerate, hits, blocked are in `counts`.
    pub(crate) fn report(&self) -> Result<(FrameReport, [u32; 4])> {
        let mut ticks = [0_u64; QUERIES as usize];
        let marks = self.stages.len() + 1;
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission is finished, so these queries were written.
        unsafe {
            self.gpu
                .vk
                .get_query_pool_results(self.queries, 0, &mut ticks[..marks], flags)
        }
        .map_err(failed("timestamps"))?;
        let ms = |a: u64, b: u64| b.wrapping_sub(a) as f64 * self.gpu.tick_ns * 1e-6;
        let mut times = StageTimes {
            device_ms: ms(ticks[0], ticks[marks - 1]),
            ..StageTimes::default()
        };
        for (i, stage) in self.stages.iter().enumerate() {
            let took = Some(ms(ticks[i], ticks[i + 1]));
            match stage {
                Stage::Interpolate => times.interpolate_ms = took,
                Stage::Preprocess => times.preprocess_ms = took,
                Stage::Refit => times.refit_ms = took,
                Stage::TracePrimary => times.trace_primary_ms = took,
                Stage::TraceShadow => times.trace_shadow_ms = took,
            }
        }
        let counts: &[u32] = self.counts_back.read(4);
        let counts = [counts[0], counts[1], counts[2], counts[3]];
        let report = FrameReport {
            times,
            hits: u64::from(counts[2]),
            blocked: u64::from(counts[3]),
            readback_bytes: self.readback_bytes,
            ..FrameReport::default()
        };
        Ok((report, counts))
    }
}

pub(crate) fn command_pool(gpu: &Gpu, family: u32) -> Result<vk::CommandPool> {
    let info = vk::CommandPoolCreateInfo::default()
        .queue_family_index(family)
        .flags(vk::CommandPoolCreateFlags::TRANSIENT);
    // SAFETY: the family belongs to the device.
    unsafe { gpu.vk.create_command_pool(&info, None) }.map_err(failed("a command pool"))
}

pub(crate) fn command_buffer(gpu: &Gpu, pool: vk::CommandPool) -> Result<vk::CommandBuffer> {
    let info = vk::CommandBufferAllocateInfo::default()
        .command_pool(pool)
        .command_buffer_count(1);
    // SAFETY: the pool belongs to the device.
    unsafe { gpu.vk.allocate_command_buffers(&info) }
        .map(|b| b[0])
        .map_err(failed("a command buffer"))
}

fn descriptor_pool(gpu: &Gpu) -> Result<vk::DescriptorPool> {
    let size = |ty, each| {
        vk::DescriptorPoolSize::default()
            .ty(ty)
            .descriptor_count(DISPATCHES * each)
    };
    let sizes = [
        size(vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1),
        size(vk::DescriptorType::STORAGE_BUFFER, 8),
    ];
    let info = vk::DescriptorPoolCreateInfo::default()
        .max_sets(DISPATCHES)
        .pool_sizes(&sizes);
    // SAFETY: the device is alive and `info` outlives the call.
    unsafe { gpu.vk.create_descriptor_pool(&info, None) }.map_err(failed("descriptors"))
}

impl Drop for Slot {
    fn drop(&mut self) {
        // SAFETY: the backend waits for the device before it drops its slots.
        unsafe {
            self.gpu.vk.destroy_command_pool(self.pool, None);
            self.gpu.vk.destroy_descriptor_pool(self.descriptors, None);
            self.gpu.vk.destroy_query_pool(self.queries, None);
        }
    }
}
