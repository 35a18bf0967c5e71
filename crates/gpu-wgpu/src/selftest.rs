//! The device's arithmetic, put to the test when it is opened.

use crate::buffers::{Window, make, storage, write};
use crate::device::Gpu;
use crate::groups::Groups;
use crate::limits::group_counts;
use crate::pipelines::Pipelines;
use backend::{BackendError, Result};
use shaders::arithmetic::Findings;
use shaders::{Params, arithmetic, work};
use wgpu::BufferUsages;

/// Runs the kernel `arithmetic` and refuses the device if one bit is wrong; else says what it found.
pub(crate) fn run(gpu: &Gpu, pipelines: &Pipelines, window: &mut Window) -> Result<Findings> {
    let all = arithmetic::operands();
    let bytes = size_of_val(all.as_slice()) as u64;
    let operands = storage(gpu, "operands", bytes)?;
    let results = storage(gpu, "results", 2 * bytes)?;
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    let params = make(gpu, "parameters", size_of::<Params>() as u64, usage)?;
    let work = work::arithmetic(all.len());
    write(gpu, &params, 0, &[work.params])?;
    write(gpu, &operands, 0, &all)?;
    let pipeline = pipelines.get(work.kernel);
    let find = |name| match name {
        "params" => &params,
        "operands" => &operands,
        _ => &results,
    };
    let group = Groups::default().get(gpu, pipeline, find)?;
    let [x, y] = group_counts(&work, &gpu.limits)?;
    let mut encoder = gpu.encoder("the test of arithmetic")?;
    gpu.guard("the test of arithmetic", 0, || {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline.wgpu);
        pass.set_bind_group(0, &group, &[0]);
        pass.dispatch_workgroups(x, y, 1);
    })?;
    gpu.submit(encoder)?;
    let found: Vec<[[u32; 4]; 2]> = window.read(gpu, &results, all.len())?;
    arithmetic::verify(&all, &found)
        .map_err(|e| BackendError::NoDevice(format!("{}: {e}", gpu.info.name)))
}
