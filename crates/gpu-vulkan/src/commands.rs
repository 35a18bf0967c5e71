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

    /// Returns the command buffer that is being recorded.
    pub fn vk(&self) -> vk::CommandBuffer {
        self.buffers[self.begun - 1]
    }

    /// Returns the command buffers recorded since the last reset.
    pub(crate) fn all(&self) -> &[vk::CommandBuffer] {
        &self.buffers[..self.begun]
    }

    /// Copies regions from one buffer to another. Records nothing without regions.
    pub(crate) fn copy(&self, [from, to]: [vk::Buffer; 2], regions: &[vk::BufferCopy]) {
        if regions.is_empty() {
            return;
        }
        let vk = &self.gpu.vk;
        // SAFETY: the command buffer is being recorded; both buffers live until it has finished, and contain the
        // regions.
        unsafe { vk.cmd_copy_buffer(self.vk(), from, to, regions) };
    }

    /// Orders all writes of `before`, in this or earlier submissions to the queue, before all accesses of `after`.
    pub fn barrier(&self, before: Reach, after: Reach) {
        let (vk, none) = (&self.gpu.vk, vk::DependencyFlags::empty());
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(before.writes)
            .dst_access_mask(after.reads | after.writes)];
        let (before, after) = (before.stages, after.stages);
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

/// Pipeline stages and access masks of one side of a barrier.
#[derive(Clone, Copy)]
pub struct Reach {
    stages: vk::PipelineStageFlags,
    reads: vk::AccessFlags,
    writes: vk::AccessFlags,
}

/// Compute kernels.
pub const KERNELS: Reach = Reach {
    stages: vk::PipelineStageFlags::COMPUTE_SHADER,
    reads: vk::AccessFlags::SHADER_READ,
    writes: vk::AccessFlags::SHADER_WRITE,
};

/// Copies and fills.
pub const COPIES: Reach = Reach {
    stages: vk::PipelineStageFlags::TRANSFER,
    reads: vk::AccessFlags::TRANSFER_READ,
    writes: vk::AccessFlags::TRANSFER_WRITE,
};

/// Compute kernels, copies and fills.
pub const ALL: Reach = KERNELS.and(COPIES);

/// Builds of the driver's own trees, including their reads of vertices.
pub const BUILDS: Reach = Reach {
    stages: vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR,
    reads: vk::AccessFlags::from_raw(
        vk::AccessFlags::SHADER_READ.as_raw()
            | vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR.as_raw(),
    ),
    writes: vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR,
};

/// Traces of rays through the driver's own trees.
pub const RAYS: Reach = Reach {
    stages: vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
    reads: BUILDS.reads,
    writes: vk::AccessFlags::SHADER_WRITE,
};

impl Reach {
    /// Returns the union.
    pub const fn and(self, other: Self) -> Self {
        Self {
            stages: vk::PipelineStageFlags::from_raw(self.stages.as_raw() | other.stages.as_raw()),
            reads: vk::AccessFlags::from_raw(self.reads.as_raw() | other.reads.as_raw()),
            writes: vk::AccessFlags::from_raw(self.writes.as_raw() | other.writes.as_raw()),
        }
    }
}

/// Host reads of mapped memory.
pub const HOST: Reach = Reach {
    stages: vk::PipelineStageFlags::HOST,
    reads: vk::AccessFlags::HOST_READ,
    writes: vk::AccessFlags::empty(),
};
