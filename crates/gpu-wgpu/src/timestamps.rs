//! Timestamps: a query set, and the stage that starts at each timestamp.

use crate::gpu::{OpenGpu, make};
use crate::limits::WITHIN_PASSES;
use backend::Result;
use gpu_common::Stage;
use wgpu::{
    Buffer, BufferUsages, CommandEncoder, ComputePass, ComputePassTimestampWrites, Features,
    QuerySet,
};

/// Timestamps per submission. Later stages are not timed.
const MARKS: usize = 32;
/// Bytes of all timestamps.
pub(crate) const BYTES: u64 = MARKS as u64 * 8;

/// Timestamps of one submission, and the stage that starts at each.
pub(crate) struct PassTimestamps {
    set: QuerySet,
    resolved: Buffer,
    /// Whether timestamps can be written between the dispatches of a pass, so that stages can share a pass.
    pub(crate) within: bool,
    pub(crate) stages: Vec<Option<Stage>>,
}

impl PassTimestamps {
    /// Returns `None` if the device has no timestamps.
    pub(crate) fn new(gpu: &OpenGpu) -> Result<Option<Self>> {
        if !gpu.features.contains(Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let desc = wgpu::QuerySetDescriptor {
            label: Some("timestamps"),
            ty: wgpu::QueryType::Timestamp,
            count: MARKS as u32,
        };
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        Ok(Some(Self {
            set: gpu.guard("timestamps", 0, || gpu.device.create_query_set(&desc))?,
            resolved: make(gpu, "timestamps", BYTES, usage)?,
            within: gpu.features.contains(WITHIN_PASSES),
            stages: Vec::with_capacity(MARKS),
        }))
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.resolved.size()
    }

    /// Reserves the timestamps of a pass: one before each stage, and one at the end. Returns the index of the first, or
    /// `None` if too few are left.
    pub(crate) fn reserve(&mut self, stages: &[Stage]) -> Option<u32> {
        let first = self.stages.len();
        if stages.is_empty() || first + stages.len() >= MARKS {
            return None;
        }
        self.stages.extend(stages.iter().copied().map(Some));
        self.stages.push(None);
        Some(first as u32)
    }

    /// Returns the timestamps at the start and the end of a pass of `stages` stages. They take 2 us less than
    /// timestamps within a pass (H200).
    pub(crate) fn around(&self, first: u32, stages: usize) -> ComputePassTimestampWrites<'_> {
        ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + stages as u32),
        }
    }

    /// Writes the timestamp before the `i`-th stage of a pass, except the first stage.
    pub(crate) fn write(&self, pass: &mut ComputePass<'_>, first: u32, i: usize) {
        if i > 0 {
            pass.write_timestamp(&self.set, first + i as u32);
        }
    }

    /// Records a copy of the timestamps to `report`, from byte `at`.
    pub(crate) fn resolve(&self, encoder: &mut CommandEncoder, report: &Buffer, at: u64) {
        let marks = self.stages.len() as u32;
        if marks > 0 {
            encoder.resolve_query_set(&self.set, 0..marks, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, report, at, u64::from(marks) * 8);
        }
    }
}
