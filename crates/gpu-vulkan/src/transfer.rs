//! The road between host and device that runs beside the frames.

use crate::device::Gpu;
use crate::encode::{copy_in_pieces, timeline};
use crate::errors::failed;
use crate::memory::Buffer;
use crate::slot::{command_buffer, command_pool};
use ash::vk;
use backend::Result;
use std::sync::Arc;

/// Copies on the transfer queue, ordered by a timeline of their own.
pub(crate) struct Transfer {
    pub(crate) done: vk::Semaphore,
    last: u64,
    lanes: Vec<Lane>,
    gpu: Arc<Gpu>,
}

/// A command buffer and the value that tells when it is free again.
struct Lane {
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    busy_until: u64,
}

impl Transfer {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let mut made = Self {
            done: timeline(gpu)?,
            last: 0,
            lanes: Vec::new(),
            gpu: Arc::clone(gpu),
        };
        for _ in 0..4 {
            let pool = command_pool(gpu, gpu.transfer.family)?;
            made.lanes.push(Lane {
                pool,
                commands: command_buffer(gpu, pool)?,
                busy_until: 0,
            });
        }
        Ok(made)
    }

    /// Copies the first `bytes` of a buffer, after `wait` (a semaphore and its
    /// value) if given. Returns the value of [`Transfer::done`] that says it is finished.
    pub(crate) fn copy(
        &mut self,
        from: &Buffer,
        to: &Buffer,
        bytes: u64,
        wait: Option<(vk::Semaphore, u64)>,
    ) -> Result<u64> {
        self.record_copy(from, to, [bytes, 0], wait)
    }

    /// Likewise, at once, to a place within the target.
    pub(crate) fn copy_to(
        &mut self,
        from: &Buffer,
        to: &Buffer,
        bytes: u64,
        at: u64,
    ) -> Result<u64> {
        self.record_copy(from, to, [bytes, at], None)
    }

    fn record_copy(
        &mut self,
        from: &Buffer,
        to: &Buffer,
        [bytes, at]: [u64; 2],
        wait: Option<(vk::Semaphore, u64)>,
    ) -> Result<u64> {
        let lane = (0..self.lanes.len())
            .min_by_key(|&i| self.lanes[i].busy_until)
            .expect("there are lanes");
        self.wait(self.lanes[lane].busy_until)?;
        let Lane { pool, commands, .. } = self.lanes[lane];
        let vk = &self.gpu.vk;
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the lane's last copy is finished, so its pool is not in use.
        unsafe {
            vk.reset_command_pool(pool, vk::CommandPoolResetFlags::empty())
                .and_then(|()| vk.begin_command_buffer(commands, &info))
                .map_err(failed("a transfer"))?;
        }
        copy_in_pieces(&self.gpu, commands, from, to, [bytes, at]);
        let to_host = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let (transfer, host) = (
            vk::PipelineStageFlags::TRANSFER,
            vk::PipelineStageFlags::HOST,
        );
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded.
        unsafe {
            vk.cmd_pipeline_barrier(commands, transfer, host, none, &to_host, &[], &[]);
            vk.end_command_buffer(commands)
                .map_err(failed("a transfer"))?;
        }
        self.submit(lane, wait)
    }

    fn submit(&mut self, lane: usize, wait: Option<(vk::Semaphore, u64)>) -> Result<u64> {
        self.last += 1;
        self.lanes[lane].busy_until = self.last;
        let (waits, wait_values): (Vec<_>, Vec<_>) = wait.into_iter().unzip();
        let stages = vec![vk::PipelineStageFlags::TRANSFER; waits.len()];
        let (signals, signal_values) = ([self.done], [self.last]);
        let mut values = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&wait_values)
            .signal_semaphore_values(&signal_values);
        let commands = [self.lanes[lane].commands];
        let submit = vk::SubmitInfo::default()
            .wait_semaphores(&waits)
            .wait_dst_stage_mask(&stages)
            .command_buffers(&commands)
            .signal_semaphores(&signals)
            .push_next(&mut values);
        // SAFETY: the backend has one owner, so the queue is used by one thread.
        unsafe {
            self.gpu
                .vk
                .queue_submit(self.gpu.transfer.queue, &[submit], vk::Fence::null())
        }
        .map_err(failed("a transfer"))?;
        Ok(self.last)
    }

    /// Whether the copy of that value is finished. Never waits.
    pub(crate) fn is_done(&self, value: u64) -> Result<bool> {
        // SAFETY: the semaphore belongs to the device.
        let now = unsafe { self.gpu.vk.get_semaphore_counter_value(self.done) };
        now.map(|now| now >= value).map_err(failed("a transfer"))
    }

    /// Waits for the copy of that value.
    pub(crate) fn wait(&self, value: u64) -> Result<()> {
        wait_for(&self.gpu, self.done, value)
    }
}

/// Blocks until a timeline reaches `value`.
pub(crate) fn wait_for(gpu: &Gpu, semaphore: vk::Semaphore, value: u64) -> Result<()> {
    let (semaphores, values) = ([semaphore], [value]);
    let info = vk::SemaphoreWaitInfo::default()
        .semaphores(&semaphores)
        .values(&values);
    // SAFETY: the semaphore belongs to the device.
    unsafe { gpu.vk.wait_semaphores(&info, u64::MAX) }.map_err(failed("waiting for a submission"))
}

impl Drop for Transfer {
    fn drop(&mut self) {
        // A lost device has nothing to wait for.
        let _ = self.wait(self.last);
        for lane in &self.lanes {
            // SAFETY: the lane's last copy is finished.
            unsafe { self.gpu.vk.destroy_command_pool(lane.pool, None) };
        }
        // SAFETY: nothing waits for the semaphore any more.
        unsafe { self.gpu.vk.destroy_semaphore(self.done, None) };
    }
}
