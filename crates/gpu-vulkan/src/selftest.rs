//! The device's arithmetic, put to the test when it is opened.

use crate::device::Gpu;
use crate::frames::Frames;
use crate::memory::{Buffer, BufferUse};
use crate::pipelines::Pipelines;
use crate::transfer::{Transfer, Window};
use backend::{BackendError, Result};
use shaders::arithmetic::Findings;
use shaders::{arithmetic, work};
use std::sync::Arc;

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong; else says what it found.
pub(crate) fn run(
    gpu: &Arc<Gpu>,
    frames: &mut Frames,
    pipelines: &Pipelines,
    (road, window): (&mut Transfer, &mut Window),
) -> Result<Findings> {
    let all = arithmetic::operands();
    let bytes = (all.len() * 16) as u64;
    let mut operands = Buffer::new(gpu, "operands", bytes, BufferUse::Upload)?;
    operands.write(0, &all);
    let results = Buffer::new(gpu, "results", 2 * bytes, BufferUse::Device)?;
    let find = |name| match name {
        "operands" => &operands,
        _ => &results,
    };
    let slot = frames.record()?;
    slot.dispatch(pipelines, &[work::arithmetic(all.len())], find)?;
    let ticket = frames.submit(&[], false, 0)?;
    frames.retire(ticket)?;
    let results = window.look(gpu, road, &results, all.len())?;
    arithmetic::verify(&all, results)
        .map_err(|e| BackendError::NoDevice(format!("{}: {e}", gpu.adapter.name)))
}
