//! Dispatches with their bind groups and parameters.

use crate::buffers::write;
use crate::gpu::{OpenGpu, make};
use crate::limits::{bindable_bytes, params_stride};
use crate::pipelines::Pipeline;
use backend::Result;
use gpu_common::{BoundBuffer, RecordedCommand, Recording};
use shaders::{BufferName, Kind, Params};
use std::collections::HashMap;
use std::convert::Infallible;
use std::num::NonZeroU64;
use wgpu::{BindGroup, Buffer, BufferBinding, BufferUsages, ComputePass, ComputePipeline};

/// Minimum capacity of the parameter buffer, in dispatches.
const LEAST: usize = 64;

/// The recordings of a wgpu device.
pub(crate) type WgpuRecording = Recording<Pipeline, Buffer, Infallible>;

/// A dispatch that is ready to be encoded.
pub(crate) struct Launch {
    pipeline: ComputePipeline,
    bind_group: BindGroup,
    /// Offset of its parameters.
    offset: u32,
    workgroups: [u32; 2],
}

/// Resources of the dispatches of one recording.
pub(crate) struct Launches {
    /// Parameters of all dispatches.
    params: Buffer,
    bind_groups: BindGroups,
    /// Bytes between the parameters of consecutive dispatches.
    stride: usize,
}

impl Launch {
    pub(crate) fn encode(&self, pass: &mut ComputePass<'_>) {
        let [x, y] = self.workgroups;
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[self.offset]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

impl Launches {
    pub(crate) fn new(gpu: &OpenGpu) -> Result<Self> {
        let stride = params_stride(&gpu.limits) as usize;
        Ok(Self {
            params: params_buffer(gpu, (LEAST * stride) as u64)?,
            bind_groups: BindGroups::default(),
            stride,
        })
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.params.size()
    }

    /// Drops the bind groups of a scene.
    pub(crate) fn unload(&mut self) {
        self.bind_groups.made.clear();
    }

    /// Writes the parameters of all dispatches of a recording to the device, and binds each dispatch to its buffers.
    /// Its [trace index](shaders::work::Work::trace_index) selects one of the `counts` buffers.
    pub(crate) fn bind(
        &mut self,
        gpu: &OpenGpu,
        counts: &[Buffer],
        recording: &WgpuRecording,
    ) -> Result<Vec<Launch>> {
        let commands = recording.commands.iter();
        let dispatches = commands.filter_map(|command| match command {
            RecordedCommand::Dispatch(dispatch) => Some(dispatch),
            _ => None,
        });
        let mut rows = Vec::new();
        for dispatch in dispatches.clone() {
            let end = rows.len() + self.stride;
            rows.extend_from_slice(bytemuck::bytes_of(&dispatch.work.params));
            rows.resize(end, 0);
        }
        let needed = rows.len() as u64;
        if needed > self.params.size() {
            self.params = params_buffer(gpu, needed.next_power_of_two())?;
        }
        write(gpu, &self.params, 0, &rows)?;
        self.bind_groups.refresh(gpu);
        let launches = dispatches.enumerate().map(|(i, dispatch)| {
            let counts = &counts[dispatch.work.trace_index % counts.len()];
            let bound = recording.buffers_of(dispatch).iter();
            let buffers = bound.map(|bound| match bound {
                BoundBuffer::Params => self.params.clone(),
                BoundBuffer::Counts => counts.clone(),
                BoundBuffer::Recorded(buffer) => buffer.clone(),
            });
            let pipeline = &dispatch.pipeline;
            Ok(Launch {
                bind_group: self.bind_groups.get(gpu, pipeline, buffers.collect())?,
                pipeline: pipeline.wgpu.clone(),
                offset: (i * self.stride) as u32,
                workgroups: dispatch.groups,
            })
        });
        launches.collect()
    }
}

/// Creates a buffer for parameters.
pub(crate) fn params_buffer(gpu: &OpenGpu, bytes: u64) -> Result<Buffer> {
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    make(gpu, "parameters", bytes, usage)
}

/// Bind groups by kernel and buffers.
///
/// A bind group keeps its buffers alive. A new buffer may replace one that only a bind group still holds. So all bind
/// groups are dropped once a buffer was created. In a steady state, bind groups are created only for copies.
#[derive(Default)]
struct BindGroups {
    made: HashMap<(&'static str, Vec<Buffer>), BindGroup>,
    buffers_made: u64,
}

impl BindGroups {
    /// Drops all bind groups if a buffer was created since the last call.
    fn refresh(&mut self, gpu: &OpenGpu) {
        let now = gpu.buffers_made();
        if self.buffers_made != now {
            self.made.clear();
            self.buffers_made = now;
        }
    }

    /// Returns the bind group of a kernel with its buffers, in the order of its bindings.
    fn get(
        &mut self,
        gpu: &OpenGpu,
        pipeline: &Pipeline,
        buffers: Vec<Buffer>,
    ) -> Result<BindGroup> {
        let mut bindings = pipeline.kernel.bindings.iter();
        let is_copy = bindings.any(|b| b.name == BufferName::CopySource);
        let key = (pipeline.kernel.name, buffers);
        if let Some(found) = self.made.get(&key) {
            return Ok(found.clone());
        }
        let group = bind(gpu, pipeline, &key.1)?;
        // The program may pass different buffers each time, so do not keep the group.
        if !is_copy {
            self.made.insert(key, group.clone());
        }
        Ok(group)
    }
}

/// Binds a kernel to its buffers, in the order of its bindings.
fn bind(gpu: &OpenGpu, pipeline: &Pipeline, buffers: &[Buffer]) -> Result<BindGroup> {
    let bindings = pipeline.kernel.bindings.iter().zip(buffers);
    let entries = bindings.map(|(b, buffer)| {
        let bytes = match b.kind {
            // The parameters of a single dispatch.
            Kind::Uniform => size_of::<Params>() as u64,
            // A buffer of the program may be larger than a binding.
            Kind::Read | Kind::ReadWrite => bindable_bytes(&gpu.limits, buffer),
        };
        wgpu::BindGroupEntry {
            binding: b.number,
            resource: wgpu::BindingResource::Buffer(BufferBinding {
                buffer,
                offset: 0,
                size: NonZeroU64::new(bytes),
            }),
        }
    });
    let entries: Vec<_> = entries.collect();
    let desc = wgpu::BindGroupDescriptor {
        label: Some(pipeline.kernel.name),
        layout: &pipeline.layout,
        entries: &entries,
    };
    gpu.guard(pipeline.kernel.name, 0, || {
        gpu.device.create_bind_group(&desc)
    })
}
