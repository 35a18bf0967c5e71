//! Timestamps, and the stage that starts at each.

use crate::errors::failed;
use crate::gpu::Gpu;
use ash::vk;
use backend::Result;
use gpu_common::Stage;
use std::sync::Arc;

/// Minimum number of timestamps of a query pool.
const LEAST: u32 = 16;

/// The timestamps of one submission: one at its start, and one at the end of each stage.
pub(crate) struct Timestamps {
    pool: vk::QueryPool,
    /// Number of timestamps that fit the pool.
    capacity: u32,
    /// The stage that starts at each timestamp.
    pub(crate) stages: Vec<Option<Stage>>,
    gpu: Arc<Gpu>,
}

impl Timestamps {
    pub(crate) fn new(gpu: &Arc<Gpu>, marks: u32) -> Result<Self> {
        let capacity = marks.next_power_of_two().max(LEAST);
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(capacity);
        // SAFETY: the device is alive and `info` outlives the call.
        let pool = unsafe { gpu.vk.create_query_pool(&info, None) };
        Ok(Self {
            pool: pool.map_err(failed("a read of timestamps"))?,
            capacity,
            stages: Vec::new(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Discards all timestamps, prepares for `stages` stages, and records the first timestamp. The submission that used
    /// these timestamps last must have finished.
    pub(crate) fn begin(&mut self, commands: vk::CommandBuffer, stages: usize) -> Result<()> {
        let marks = stages as u32 + 1;
        if marks > self.capacity {
            *self = Self::new(&self.gpu, marks)?;
        }
        self.stages.clear();
        if self.gpu.timestamp_bits > 0 {
            let vk = &self.gpu.vk;
            // SAFETY: the command buffer is being recorded, and no other one uses the pool.
            unsafe { vk.cmd_reset_query_pool(commands, self.pool, 0, self.capacity) };
        }
        self.mark(commands);
        Ok(())
    }

    /// Records the end of a stage.
    pub(crate) fn end(&mut self, commands: vk::CommandBuffer, stage: Stage) {
        if let Some(last) = self.stages.last_mut() {
            *last = Some(stage);
        }
        self.mark(commands);
    }

    /// Records a timestamp, taken when all work recorded before has finished.
    fn mark(&mut self, commands: vk::CommandBuffer) {
        if self.gpu.timestamp_bits == 0 {
            return;
        }
        let (vk, query) = (&self.gpu.vk, self.stages.len() as u32);
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded; the pool was reset and has a query for each stage.
        unsafe { vk.cmd_write_timestamp(commands, stage, self.pool, query) };
        self.stages.push(None);
    }

    /// Returns all timestamps of a finished submission, in ticks, or `None` without a clock.
    pub(crate) fn read(&self) -> Result<Option<Vec<u64>>> {
        if self.gpu.timestamp_bits == 0 {
            return Ok(None);
        }
        let mut ticks = vec![0_u64; self.stages.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        let vk = &self.gpu.vk;
        // SAFETY: the submission has finished, so these queries were written.
        unsafe { vk.get_query_pool_results(self.pool, 0, &mut ticks, flags) }
            .map_err(failed("a read of timestamps"))?;
        Ok(Some(ticks))
    }
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        // SAFETY: the owner waits for the submissions that use the pool.
        unsafe { self.gpu.vk.destroy_query_pool(self.pool, None) };
    }
}
