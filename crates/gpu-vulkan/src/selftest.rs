//! The device's arithmetic, put to the test when it is opened.

use crate::device::Gpu;
use crate::encode::{Groups, dispatch};
use crate::memory::{Buffer, Place};
use crate::pipelines::Pipelines;
use crate::slot::Slot;
use crate::transfer::{Transfer, wait_for};
use ash::vk;
use backend::{BackendError, Result};
use shaders::{Params, arithmetic};
use std::sync::Arc;

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong.
pub(crate) fn run(
    gpu: &Arc<Gpu>,
    slot: &mut Slot,
    pipelines: &Pipelines,
    transfer: &mut Transfer,
    submit: impl FnOnce(vk::CommandBuffer) -> Result<(vk::Semaphore, u64)>,
) -> Result<()> {
    let all = arithmetic::operands();
    let bytes = (all.len() * 16) as u64;
    let mut operands = Buffer::new(gpu, "operands", bytes, Place::Upload)?;
    operands.write(0, &all);
    let results = Buffer::new(gpu, "results", bytes, Place::Device)?;
    let view = Buffer::new(gpu, "results", bytes, Place::Readback)?;
    let params = Params {
        count: all.len() as u32,
        ..Params::default()
    };
    slot.begin()?;
    let find = |name| {
        if name == "operands" {
            (&operands).into()
        } else {
            (&results).into()
        }
    };
    let pipeline = pipelines.get("arithmetic");
    dispatch(
        gpu,
        slot,
        pipeline,
        &params,
        Groups::Linear(params.count),
        find,
    )?;
    slot.end()?;
    let (semaphore, value) = submit(slot.commands)?;
    wait_for(gpu, semaphore, value)?;
    let done = transfer.copy(&results, &view, bytes, Some((semaphore, value)))?;
    transfer.wait(done)?;
    arithmetic::verify(&all, view.read(all.len()))
        .map_err(|e| BackendError::NoDevice(format!("{}: {e}", gpu.adapter.name)))
}
