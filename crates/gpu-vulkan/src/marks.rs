//! Timestamps, and the stage that starts at each.

use crate::errors::failed;
use crate::gpu::Gpu;
use ash::vk;
use backend::Result;
use gpu_common::Stage;
use std::sync::Arc;

/// Timestamps per query pool. Pools are added as needed.
const MARKS: usize = 16;

/// The timestamps of one submission: one at its start, and one at the end of each stage.
pub(crate) struct Timestamps {
    pools: Vec<vk::QueryPool>,
    /// The stage that starts at each timestamp.
    pub(crate) stages: Vec<Option<Stage>>,
    gpu: Arc<Gpu>,
}

impl Timestamps {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        Self {
            pools: Vec::new(),
            stages: Vec::new(),
            gpu: Arc::clone(gpu),
        }
    }

    /// Discards the timestamps of the previous submission, which must have finished, and records the first.
    pub(crate) fn begin(&mut self, commands: vk::CommandBuffer) -> Result<()> {
        self.stages.clear();
        self.mark(commands)
    }

    /// Records the end of a stage.
    pub(crate) fn end(&mut self, commands: vk::CommandBuffer, stage: Stage) -> Result<()> {
        if let Some(last) = self.stages.last_mut() {
            *last = Some(stage);
        }
        self.mark(commands)
    }

    /// Records a timestamp, taken when all work recorded before has finished.
    fn mark(&mut self, commands: vk::CommandBuffer) -> Result<()> {
        if self.gpu.timestamp_bits == 0 {
            return Ok(());
        }
        let used = self.stages.len();
        let (page, query) = (used / MARKS, (used % MARKS) as u32);
        if page == self.pools.len() {
            self.pools.push(query_pool(&self.gpu)?);
        }
        let (vk, pool) = (&self.gpu.vk, self.pools[page]);
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is being recorded; queries are reset in it before they are written.
        unsafe {
            if query == 0 {
                vk.cmd_reset_query_pool(commands, pool, 0, MARKS as u32);
            }
            vk.cmd_write_timestamp(commands, stage, pool, query);
        }
        self.stages.push(None);
        Ok(())
    }

    /// Returns all timestamps of a finished submission, in ticks, or `None` without a clock.
    pub(crate) fn read(&self) -> Result<Option<Vec<u64>>> {
        if self.gpu.timestamp_bits == 0 {
            return Ok(None);
        }
        let mut ticks = vec![0_u64; self.stages.len()];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        for (ticks, &pool) in ticks.chunks_mut(MARKS).zip(&self.pools) {
            // SAFETY: the submission has finished, so these queries were written.
            unsafe { self.gpu.vk.get_query_pool_results(pool, 0, ticks, flags) }
                .map_err(failed("timestamps"))?;
        }
        Ok(Some(ticks))
    }
}

fn query_pool(gpu: &Gpu) -> Result<vk::QueryPool> {
    let info = vk::QueryPoolCreateInfo::default()
        .query_type(vk::QueryType::TIMESTAMP)
        .query_count(MARKS as u32);
    // SAFETY: the device is alive and `info` outlives the call.
    unsafe { gpu.vk.create_query_pool(&info, None) }.map_err(failed("timestamps"))
}

impl Drop for Timestamps {
    fn drop(&mut self) {
        for &pool in &self.pools {
            // SAFETY: the backend waits for the device before it drops its slots.
            unsafe { self.gpu.vk.destroy_query_pool(pool, None) };
        }
    }
}
