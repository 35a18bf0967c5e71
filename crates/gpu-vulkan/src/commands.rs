//! Command buffers, and what is recorded into them everywhere.

use crate::errors::failed;
use crate::gpu::Gpu;
use crate::memory::Buffer;
use ash::vk;
use backend::Result;
use std::sync::Arc;

/// A pool whose command buffers are recorded and reset together.
pub struct Commands {
    pool: vk::CommandPool,
    buffers: Vec<vk::CommandBuffer>,
    /// Buffers begun since the last reset.
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

    /// Forgets what was recorded. It must not be under way any more.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.begun = 0;
        let none = vk::CommandPoolResetFlags::empty();
        // SAFETY: the last submission is finished, so the pool is not in use.
        unsafe { self.gpu.vk.reset_command_pool(self.pool, none) }.map_err(failed("recording"))
    }

    /// Begins a further buffer, to be submitted once.
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
        // SAFETY: the buffer was reset with its pool.
        unsafe { self.gpu.vk.begin_command_buffer(buffer, &info) }.map_err(failed("recording"))?;
        self.begun += 1;
        Ok(())
    }

    /// Ends the buffer being recorded.
    pub(crate) fn end(&self) -> Result<()> {
        // SAFETY: the buffer is being recorded.
        unsafe { self.gpu.vk.end_command_buffer(self.vk()) }.map_err(failed("recording"))
    }

    /// The buffer being recorded.
    pub fn vk(&self) -> vk::CommandBuffer {
        self.buffers[self.begun - 1]
    }

    /// All buffers recorded since the last reset.
    pub(crate) fn all(&self) -> &[vk::CommandBuffer] {
        &self.buffers[..self.begun]
    }

    /// Copies regions, if any, from one buffer to another.
    pub(crate) fn copy(&self, [from, to]: [&Buffer; 2], regions: &[vk::BufferCopy]) {
        if regions.is_empty() {
            return;
        }
        let vk = &self.gpu.vk;
        // SAFETY: the command buffer is being recorded; both buffers live until it is done, and hold the bytes.
        unsafe { vk.cmd_copy_buffer(self.vk(), from.vk, to.vk, regions) };
    }

    /// What `before` writes, here or in earlier submissions to the queue, comes before what `after` does with it.
    pub fn barrier(&self, before: Reach, after: Reach) {
        let (vk, none) = (&self.gpu.vk, vk::DependencyFlags::empty());
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(before.writes)
            .dst_access_mask(after.reads | after.writes)];
        let (before, after) = (before.stages, after.stages);
        // SAFETY: the buffer is being recorded.
        unsafe { vk.cmd_pipeline_barrier(self.vk(), before, after, none, &memory, &[], &[]) };
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // SAFETY: the owner waits for what was submitted.
        unsafe { self.gpu.vk.destroy_command_pool(self.pool, None) };
    }
}

/// One side of a barrier.
#[derive(Clone, Copy)]
pub struct Reach {
    stages: vk::PipelineStageFlags,
    reads: vk::AccessFlags,
    writes: vk::AccessFlags,
}

/// Kernels.
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

/// Both.
pub const ALL: Reach = KERNELS.and(COPIES);

/// The driver's work on its own trees, and the vertices that it reads.
pub const BUILDS: Reach = Reach {
    stages: vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR,
    reads: vk::AccessFlags::from_raw(
        vk::AccessFlags::SHADER_READ.as_raw()
            | vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR.as_raw(),
    ),
    writes: vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR,
};

/// Rays through the driver's own trees.
pub const RAYS: Reach = Reach {
    stages: vk::PipelineStageFlags::RAY_TRACING_SHADER_KHR,
    reads: BUILDS.reads,
    writes: vk::AccessFlags::SHADER_WRITE,
};

impl Reach {
    /// Both.
    pub const fn and(self, other: Self) -> Self {
        Self {
            stages: vk::PipelineStageFlags::from_raw(self.stages.as_raw() | other.stages.as_raw()),
            reads: vk::AccessFlags::from_raw(self.reads.as_raw() | other.reads.as_raw()),
            writes: vk::AccessFlags::from_raw(self.writes.as_raw() | other.writes.as_raw()),
        }
    }
}

/// The host, which reads mapped memory.
pub const HOST: Reach = Reach {
    stages: vk::PipelineStageFlags::HOST,
    reads: vk::AccessFlags::HOST_READ,
    writes: vk::AccessFlags::empty(),
};
