//! The device's arithmetic, put to the test when it is opened.

use crate::buffers::{Window, make, storage, write};
use crate::device::Gpu;
use crate::encode::{Groups, bind};
use crate::pipelines::Pipelines;
use backend::{BackendError, Result};
use shaders::{Params, arithmetic};
use wgpu::BufferUsages;

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong.
pub(crate) fn run(gpu: &Gpu, pipelines: &Pipelines, window: &mut Window) -> Result<()> {
    let all = arithmetic::operands();
    let bytes = size_of_val(all.as_slice()) as u64;
    let operands = storage(gpu, "operands", bytes)?;
    let results = storage(gpu, "results", bytes)?;
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    let params = make(gpu, "parameters", size_of::<Params>() as u64, usage)?;
    let row = Params {
        count: all.len() as u32,
        ..Params::default()
    };
    write(gpu, &params, 0, &[row])?;
    write(gpu, &operands, 0, &all)?;
    let pipeline = pipelines.get("arithmetic");
    let find = |name| match name {
        "operands" => &operands,
        _ => &results,
    };
    let group = bind(gpu, pipeline, &params, find)?;
    let limit = gpu.limits.max_compute_workgroups_per_dimension;
    let [x, y] = Groups::Linear(row.count).count(pipeline.kernel.workgroup[0], limit)?;
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    gpu.guard("the test of arithmetic", 0, || {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline.wgpu);
        pass.set_bind_group(0, &group, &[0]);
        pass.dispatch_workgroups(x, y, 1);
    })?;
    gpu.submit(encoder)?;
    let found: Vec<[u32; 4]> = window.read(gpu, &results, all.len())?;
    arithmetic::verify(&all, &found)
        .map_err(|e| BackendError::NoDevice(format!("{}: {e}", gpu.info.name)))
}
