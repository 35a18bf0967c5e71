//! Timeline semaphores, and submissions ordered by them.

use crate::errors::failed;
use crate::gpu::{Gpu, Queue};
use ash::vk;
use backend::Result;
use geom::lock;
use std::slice::from_ref;
use std::sync::Arc;

/// A semaphore and the value that it must reach.
pub type SemaphoreValue = (vk::Semaphore, u64);

/// A timeline semaphore.
pub struct Timeline {
    vk: vk::Semaphore,
    pub(crate) gpu: Arc<Gpu>,
}

/// Number of polls before a blocking wait. A poll takes about 50 ns; waking a blocked thread takes about 30 us.
const POLLS: u32 = 400;

impl Timeline {
    /// Creates a timeline with value 0.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        Self::with(gpu, None)
    }

    pub(crate) fn with(
        gpu: &Arc<Gpu>,
        mut export: Option<vk::ExportSemaphoreCreateInfo<'_>>,
    ) -> Result<Self> {
        let mut kind =
            vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let mut info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        if let Some(export) = &mut export {
            info = info.push_next(export);
        }
        // SAFETY: the device is alive; timeline semaphores are enabled, and so is the extension of `export`.
        let vk = unsafe { gpu.vk.create_semaphore(&info, None) }.map_err(failed("a semaphore"))?;
        let gpu = Arc::clone(gpu);
        Ok(Self { vk, gpu })
    }

    /// Returns the semaphore with `value`, to wait for it or to signal it.
    pub fn at(&self, value: u64) -> SemaphoreValue {
        (self.vk, value)
    }

    /// Returns the current value. Never blocks.
    pub(crate) fn value(&self) -> Result<u64> {
        // SAFETY: the semaphore belongs to the device.
        let now = unsafe { self.gpu.vk.get_semaphore_counter_value(self.vk) };
        now.map_err(failed("a read of a semaphore"))
    }

    /// Returns whether `value` is reached. Never blocks.
    pub fn has_reached(&self, value: u64) -> Result<bool> {
        Ok(self.value()? >= value)
    }

    /// Blocks until `value` is reached.
    pub(crate) fn wait(&self, value: u64) -> Result<()> {
        // A software driver needs the host's cores, so do not spin.
        let polls = if self.gpu.is_software() { 1 } else { POLLS };
        for _ in 0..polls {
            if self.has_reached(value)? {
                return Ok(());
            }
            std::hint::spin_loop();
        }
        let (semaphores, values) = ([self.vk], [value]);
        let info = vk::SemaphoreWaitInfo::default()
            .semaphores(&semaphores)
            .values(&values);
        // SAFETY: the semaphore belongs to the device.
        unsafe { self.gpu.vk.wait_semaphores(&info, u64::MAX) }
            .map_err(failed("a wait for a submission"))
    }

    /// Sets the timeline to `value` from the host.
    pub fn signal(&self, value: u64) -> Result<()> {
        let info = vk::SemaphoreSignalInfo::default()
            .semaphore(self.vk)
            .value(value);
        // SAFETY: the semaphore belongs to the device.
        unsafe { self.gpu.vk.signal_semaphore(&info) }.map_err(failed("a signal"))
    }
}

impl Drop for Timeline {
    fn drop(&mut self) {
        // SAFETY: the owner waits for all work that signals the semaphore or waits for it.
        unsafe { self.gpu.vk.destroy_semaphore(self.vk, None) };
    }
}

/// An optional command buffer, with the semaphore values to wait for before it and the one to signal after it.
#[derive(Clone, Copy)]
pub(crate) struct QueueBatch<'a> {
    pub(crate) commands: Option<vk::CommandBuffer>,
    pub(crate) after: &'a [SemaphoreValue],
    pub(crate) done: SemaphoreValue,
}

/// Submits batches to a queue in one call.
pub(crate) fn submit(gpu: &Gpu, queue: &Queue, batches: &[QueueBatch<'_>]) -> Result<()> {
    let waits = batches.iter().map(|b| b.after.iter().copied().unzip());
    let waits: Vec<(Vec<_>, Vec<_>)> = waits.collect();
    let all = || batches.iter().zip(&waits);
    let values = all().map(|(batch, (_, values))| {
        vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(values)
            .signal_semaphore_values(from_ref(&batch.done.1))
    });
    let mut values: Vec<_> = values.collect();
    // All pipeline stages wait, including the one that writes timestamps. So the times of the frame's stages do not
    // include the wait.
    let most = waits.iter().map(|(semaphores, _)| semaphores.len()).max();
    let stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; most.unwrap_or(0)];
    let infos = all().zip(&mut values).map(|((batch, (waits, _)), values)| {
        vk::SubmitInfo::default()
            .wait_semaphores(waits)
            .wait_dst_stage_mask(&stages[..waits.len()])
            .command_buffers(batch.commands.as_slice())
            .signal_semaphores(from_ref(&batch.done.0))
            .push_next(values)
    });
    let infos: Vec<_> = infos.collect();
    let (_lock, queue) = (gpu.memory.lock_driver(), lock(&queue.queue));
    // SAFETY: the lock excludes other users of the queue; all command buffers are alive.
    unsafe { gpu.vk.queue_submit(*queue, &infos, vk::Fence::null()) }
        .map_err(failed("a submission"))
}
