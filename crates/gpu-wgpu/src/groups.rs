//! Bind groups: which buffers a kernel sees under which names. Made once, found again each frame.

use crate::gpu::Gpu;
use crate::pipelines::Pipeline;
use backend::Result;
use shaders::{BufferName, Kind, Params};
use std::collections::HashMap;
use std::num::NonZeroU64;
use wgpu::{BindGroup, Buffer, BufferBinding};

/// Bind groups by kernel and buffers.
///
/// A group keeps its buffers alive, so all are dropped when a buffer was made
/// since: it may stand in for one that nothing else holds any more. A steady
/// frame makes none.
#[derive(Default)]
pub(crate) struct Groups {
    made: HashMap<(&'static str, Vec<Buffer>), BindGroup>,
    buffers_made: u64,
}

impl Groups {
    /// Drops all if a buffer was made since the last call.
    pub(crate) fn refresh(&mut self, gpu: &Gpu) {
        let now = gpu.call_counts().buffers;
        if self.buffers_made != now {
            self.made.clear();
            self.buffers_made = now;
        }
    }

    /// Drops all.
    pub(crate) fn clear(&mut self) {
        self.made.clear();
    }

    /// The group that binds a kernel to its buffers.
    pub(crate) fn get<'a>(
        &mut self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        find: impl Fn(BufferName) -> &'a Buffer,
    ) -> Result<BindGroup> {
        let bindings = pipeline.kernel.bindings.iter();
        let buffers: Vec<Buffer> = bindings.map(|b| find(b.name).clone()).collect();
        let key = (pipeline.kernel.name, buffers);
        if let Some(found) = self.made.get(&key) {
            return Ok(found.clone());
        }
        let group = bind(gpu, pipeline, &key.1)?;
        self.made.insert(key, group.clone());
        Ok(group)
    }
}

/// Binds a kernel to its buffers, in the order of its bindings.
fn bind(gpu: &Gpu, pipeline: &Pipeline, buffers: &[Buffer]) -> Result<BindGroup> {
    let bindings = pipeline.kernel.bindings.iter().zip(buffers);
    let entries: Vec<_> = bindings
        .map(|(b, buffer)| wgpu::BindGroupEntry {
            binding: b.number,
            resource: match b.kind {
                Kind::Uniform => wgpu::BindingResource::Buffer(one_row(buffer)),
                Kind::Read | Kind::ReadWrite => buffer.as_entire_binding(),
            },
        })
        .collect();
    let desc = wgpu::BindGroupDescriptor {
        label: Some(pipeline.kernel.name),
        layout: &pipeline.layout,
        entries: &entries,
    };
    gpu.count(|t| t.bind_groups += 1);
    gpu.guard(pipeline.kernel.name, 0, || {
        gpu.device.create_bind_group(&desc)
    })
}

fn one_row(params: &Buffer) -> BufferBinding<'_> {
    BufferBinding {
        buffer: params,
        offset: 0,
        size: NonZeroU64::new(size_of::<Params>() as u64),
    }
}
