//! The device's arithmetic, put to the test when it is opened.

use crate::{BufferTable, Frames, GpuDevice, Pipelines};
use backend::{BackendError, Result};
use shaders::arithmetic::{self, Findings};
use shaders::{BufferName, work};

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong or its driver ends loops early; else says what
/// it found.
pub(crate) fn run<D: GpuDevice>(
    gpu: &mut D,
    frames: &mut Frames<D>,
    pipelines: &Pipelines<D>,
) -> Result<Findings> {
    let all = arithmetic::operands();
    let bytes = size_of_val(all.as_slice()) as u64;
    let sizes = [
        (BufferName::Operands, bytes),
        (BufferName::Results, 2 * bytes),
    ];
    let buffers = BufferTable::new(gpu, sizes)?;
    let find = |name| buffers.get(name).expect("it names no other buffer");
    gpu.upload(&[(bytemuck::cast_slice(&all), find(BufferName::Operands))])?;
    let work = [work::arithmetic(all.len())];
    let slot = frames.record(gpu)?;
    slot.record_untimed(gpu, pipelines, &work, &find)?;
    let (ticket, _) = frames.submit(gpu, None, (false, 0))?;
    frames.retire(gpu, ticket)?;
    let verified = gpu.read(find(BufferName::Results), all.len(), |results| {
        arithmetic::verify(&all, results)
    })?;
    let adapter = gpu.about().adapter;
    verified.map_err(|e| BackendError::NoDevice(format!("{adapter}: {e}")))
}
