//! Command buffers and barriers.

use crate::errors::failed;
use crate::gpu::Gpu;
use ash::vk;
use backend::Result;
use std::sync::Arc;

/// A pool whose command buffers are recorded and reset together.
pub struct Commands {
    pool: vk::CommandPool,
    buffers: Vec<vk::CommandBuffer>,
    /// Number of command buffers begun since the last reset.
    begun: usize,
    gpu: Arc<Gpu>,
}

impl Commands {
    pub(crate) fn new(gpu: &Arc<Gpu>, family: u32) -> Result<Self> {
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family belongs to the device.
        let pool =
            unsafe { gpu.vk.create_command_pool(&info, None) }.map_err(failed("a command pool"))?;
        Ok(Self {
            pool,
            buffers: Vec::new(),
            begun: 0,
            gpu: Arc::clone(gpu),
        })
    }

    /// Resets the pool. Its command buffers must have finished.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.begun = 0;
        let none = vk::CommandPoolResetFlags::empty();
        // SAFETY: the last submission has finished, so the pool is not in use.
        unsafe { self.gpu.vk.reset_command_pool(self.pool, none) }.map_err(failed("recording"))
    }

    /// Begins another command buffer, to be submitted once.
    pub(crate) fn begin(&mut self) -> Result<()> {
        if self.begun == self.buffers.len() {
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(self.pool)
                .command_buffer_count(1);
            // SAFETY: the pool belongs to the device.
            let made = unsafe { self.gpu.vk.allocate_command_buffers(&info) };
            self.buffers.extend(made.map_err(failed("recording"))?);
        }
        let flags = vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT;
        let info = vk::CommandBufferBeginInfo::default().flags(flags);
        let buffer = self.buffers[self.begun];
        // SAFETY: the command buffer was reset with its pool.
        unsafe { self.gpu.vk.begin_command_buffer(buffer, &info) }.map_err(failed("recording"))?;
        self.begun += 1;
        Ok(())
    }

    /// Ends the current command buffer.
    pub(crate) fn end(&self) -> Result<()> {
        // SAFETY: the command buffer is being recorded.
        unsafe { self.gpu.vk.end_command_buffer(self.vk()) }.map_err(failed("recording"))
    }

    /// Returns the command buffer that was begun last.
    pub fn vk(&self) -> vk::CommandBuffer {
        self.buffers[self.begun - 1]
    }

    /// Returns the command buffers recorded since the last reset.
    pub(crate) fn all(&self) -> &[vk::CommandBuffer] {
        &self.buffers[..self.begun]
    }

    /// Copies regions from one buffer to another. Records nothing without regions.
    pub(crate) fn copy(&self, from: vk::Buffer, to: vk::Buffer, regions: &[vk::BufferCopy]) {
        if regions.is_empty() {
            return;
        }
        let vk = &self.gpu.vk;
        // SAFETY: the command buffer is being recorded; both buffers live until it has finished, and contain the
        // regions.
        unsafe { vk.cmd_copy_buffer(self.vk(), from, to, regions) };
    }

    /// Orders all writes of the stages `before` before all accesses of the stages `after`. Includes writes of earlier
    /// submissions to the queue.
    pub fn barrier(&self, before: vk::PipelineStageFlags, after: vk::PipelineStageFlags) {
        let (vk, none) = (&self.gpu.vk, vk::DependencyFlags::empty());
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(writes_of(before))
            .dst_access_mask(reads_of(after) | writes_of(after))];
        // SAFETY: the command buffer is being recorded.
        unsafe { vk.cmd_pipeline_barrier(self.vk(), before, after, none, &memory, &[], &[]) };
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // SAFETY: the owner waits for its submissions first.
        unsafe { self.gpu.vk.destroy_command_pool(self.pool, None) };
    }
}

/// Returns the write accesses of stages. `MEMORY_WRITE` for every stage would make frames 5 % slower on an H200.
fn writes_of(stages: vk::PipelineStageFlags) -> vk::AccessFlags {
    let mut writes = vk::AccessFlags::empty();
    if stages.intersects(KERNELS | RAYS) {
        writes |= vk::AccessFlags::SHADER_WRITE;
    }
    if stages.contains(COPIES) {
        writes |= vk::AccessFlags::TRANSFER_WRITE;
    }
    if stages.contains(BUILDS) {
        writes |= vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
    }
    writes
}

/// Returns the read accesses of stages.
fn reads_of(stages: vk::PipelineStageFlags) -> vk::AccessFlags {
    let mut reads = vk::AccessFlags::empty();
    if stages.intersects(KERNELS | RAYS | BUILDS) {
        reads |= vk::AccessFlags::SHADER_READ;
    }
    if stages.contains(COPIES) {
        reads |= vk::AccessFlags::TRANSFER_READ;
    }
    if stages.intersects(BUILDS | RAYS) {
        reads |= vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR;
    }
    if stages.contains(HOST) {
        reads |= vk::AccessFlags::HOST_READ;
    }
    reads
}

/// Compute kernels.
pub const KERNELS: vk::PipelineStageFlags = vk::PipelineStageFlags::COMPUTE_SHADER;

/// Copies and fills.
pub const COPIES: vk::PipelineStageFlags = vk::PipelineStageFlags::TRANSFER;

/// Builds of acceleration structures, including their reads of vertices.
pub const BUILDS: vk::PipelineStageFlags = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;

/// Traces of rays through acceleration structures.
pub const RAYS: vk::PipelineStageFlags = vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR;

/// Host reads of mapped memory.
pub const HOST: vk::PipelineStageFlags = vk::PipelineStageFlags::HOST;
