//! Semaphores whose value only rises, and submissions ordered by them.

use crate::device::{Gpu, Queue};
use crate::errors::failed;
use ash::vk;
use backend::Result;
use std::sync::Arc;

/// When a timeline reaches a value.
pub(crate) type Moment = (vk::Semaphore, u64);

/// A semaphore whose value only rises.
pub(crate) struct Timeline {
    vk: vk::Semaphore,
    gpu: Arc<Gpu>,
}

/// Looks at a counter before asking the system to wait: a look takes some 50 ns, being woken some 30 us.
const LOOKS: u32 = 400;

impl Timeline {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let mut kind =
            vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive; timeline semaphores were asked for.
        let vk = unsafe { gpu.vk.create_semaphore(&info, None) }.map_err(failed("a semaphore"))?;
        let gpu = Arc::clone(gpu);
        Ok(Self { vk, gpu })
    }

    pub(crate) fn at(&self, value: u64) -> Moment {
        (self.vk, value)
    }

    /// Whether `value` is reached. Never waits.
    pub(crate) fn has_reached(&self, value: u64) -> Result<bool> {
        // SAFETY: the semaphore belongs to the device.
        let now = unsafe { self.gpu.vk.get_semaphore_counter_value(self.vk) };
        now.map(|now| now >= value)
            .map_err(failed("asking for a submission"))
    }

    /// Blocks until `value` is reached.
    pub(crate) fn wait(&self, value: u64) -> Result<()> {
        // A driver on the host's cores needs them more than the one who waits.
        let looks = if self.gpu.is_software() { 1 } else { LOOKS };
        for _ in 0..looks {
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
            .map_err(failed("waiting for a submission"))
    }

    /// Reaches `value` by the host's hand.
    #[cfg(test)]
    pub(crate) fn signal(&self, value: u64) {
        let info = vk::SemaphoreSignalInfo::default()
            .semaphore(self.vk)
            .value(value);
        // SAFETY: the semaphore belongs to the device; tests raise values that nothing else does.
        unsafe { self.gpu.vk.signal_semaphore(&info) }.unwrap();
    }
}

impl Drop for Timeline {
    fn drop(&mut self) {
        // SAFETY: the owner waits for all that signals it or waits for it.
        unsafe { self.gpu.vk.destroy_semaphore(self.vk, None) };
    }
}

/// Submits commands, to begin after some moments (as far as `stage` goes) and to end with another.
pub(crate) fn submit(
    gpu: &Gpu,
    queue: Queue,
    commands: vk::CommandBuffer,
    (after, stage): (&[Moment], vk::PipelineStageFlags),
    (done, value): Moment,
) -> Result<()> {
    let (waits, wait_values): (Vec<_>, Vec<_>) = after.iter().copied().unzip();
    let stages = vec![stage; waits.len()];
    let (signals, signal_values) = ([done], [value]);
    let mut values = vk::TimelineSemaphoreSubmitInfo::default()
        .wait_semaphore_values(&wait_values)
        .signal_semaphore_values(&signal_values);
    let commands = [commands];
    let info = vk::SubmitInfo::default()
        .wait_semaphores(&waits)
        .wait_dst_stage_mask(&stages)
        .command_buffers(&commands)
        .signal_semaphores(&signals)
        .push_next(&mut values);
    // SAFETY: the backend has one owner, so the queue is used by one thread; all buffers live.
    unsafe { gpu.vk.queue_submit(queue.queue, &[info], vk::Fence::null()) }
        .map_err(failed("a submission"))
}
