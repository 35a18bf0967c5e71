//! Semaphores whose value only rises, and submissions ordered by them.

use crate::errors::failed;
use crate::gpu::{Gpu, Queue};
use ash::vk;
use backend::Result;
use geom::lock;
use std::slice::from_ref;
use std::sync::Arc;

/// When a timeline reaches a value.
pub type Moment = (vk::Semaphore, u64);

/// A semaphore whose value only rises.
pub struct Timeline {
    vk: vk::Semaphore,
    pub(crate) gpu: Arc<Gpu>,
}

/// Looks at a counter before asking the system to wait: a look takes some 50 ns, being woken some 30 us.
const LOOKS: u32 = 400;

impl Timeline {
    /// One at 0.
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
        // SAFETY: the device is alive; timeline semaphores were asked for, and so was whatever exports them.
        let vk = unsafe { gpu.vk.create_semaphore(&info, None) }.map_err(failed("a semaphore"))?;
        let gpu = Arc::clone(gpu);
        Ok(Self { vk, gpu })
    }

    /// When it reaches `value`.
    pub fn at(&self, value: u64) -> Moment {
        (self.vk, value)
    }

    /// Whether `value` is reached. Never waits.
    pub fn has_reached(&self, value: u64) -> Result<bool> {
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
        // SAFETY: the owner waits for all that signals it or waits for it.
        unsafe { self.gpu.vk.destroy_semaphore(self.vk, None) };
    }
}

/// Commands, if any, that begin after some moments, and the moment at which they are done.
#[derive(Clone, Copy)]
pub(crate) struct Batch<'a> {
    pub(crate) commands: Option<vk::CommandBuffer>,
    pub(crate) after: &'a [Moment],
    pub(crate) done: Moment,
}

/// Submits batches to a queue, all in one call.
pub(crate) fn submit(gpu: &Gpu, queue: &Queue, batches: &[Batch<'_>]) -> Result<()> {
    let waits = batches.iter().map(|b| b.after.iter().copied().unzip());
    let waits: Vec<(Vec<_>, Vec<_>)> = waits.collect();
    let all = || batches.iter().zip(&waits);
    let values = all().map(|(batch, (_, values))| {
        vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(values)
            .signal_semaphore_values(from_ref(&batch.done.1))
    });
    let mut values: Vec<_> = values.collect();
    // Marks of time wait too, so that no stage is charged with waiting.
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
    let (_turn, queue) = (gpu.memory.turn(), lock(&queue.queue));
    // SAFETY: who holds the lock alone uses the queue; all buffers live.
    unsafe { gpu.vk.queue_submit(*queue, &infos, vk::Fence::null()) }
        .map_err(failed("a submission"))
}
