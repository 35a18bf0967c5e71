//! Dispatches with their bind groups, and pages of parameters.

use crate::buffers::write;
use crate::gpu::{OpenGpu, make};
use crate::limits::params_stride;
use crate::pipelines::Pipeline;
use backend::Result;
use gpu_common::{BoundBuffer, Dispatch, RecordedCommand, Recording};
use shaders::{BufferName, Kind, Params};
use std::collections::HashMap;
use std::convert::Infallible;
use std::num::NonZeroU64;
use wgpu::{BindGroup, Buffer, BufferBinding, BufferUsages, ComputePass, ComputePipeline};

/// Rows of parameters per buffer. Buffers are added as needed.
const ROWS: usize = 64;

/// The recordings of a wgpu device.
pub(crate) type WgpuRecording = Recording<Pipeline, Buffer, Infallible>;

/// A dispatch that is ready to be encoded.
pub(crate) struct Launch {
    pipeline: ComputePipeline,
    group: BindGroup,
    /// Offset of its parameters.
    offset: u32,
    groups: [u32; 2],
}

/// Resources of the dispatches of one recording.
pub(crate) struct Launches {
    pages: Vec<Buffer>,
    groups: BindGroups,
    stride: usize,
    /// Parameters, to be written to the pages.
    rows: Vec<u8>,
    /// An empty vector that keeps its capacity.
    spare: Vec<Launch>,
}

impl Launch {
    pub(crate) fn go(&self, pass: &mut ComputePass<'_>) {
        let [x, y] = self.groups;
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[self.offset]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

impl Launches {
    pub(crate) fn new(gpu: &OpenGpu) -> Self {
        Self {
            pages: Vec::new(),
            groups: BindGroups::default(),
            stride: params_stride(&gpu.limits) as usize,
            rows: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Returns the bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.pages.iter().map(Buffer::size).sum()
    }

    /// Drops the buffers of a scene.
    pub(crate) fn forget(&mut self) {
        self.groups.made.clear();
    }

    /// Binds the dispatches of a recording to their buffers, in order. The counts are those of the dispatch's
    /// [place](shaders::work::Work::place).
    pub(crate) fn make(
        &mut self,
        gpu: &OpenGpu,
        counts: &[Buffer],
        recording: &WgpuRecording,
    ) -> Result<Vec<Launch>> {
        self.groups.refresh(gpu);
        self.rows.clear();
        let commands = recording.commands.iter();
        let dispatches = commands.filter_map(|command| match command {
            RecordedCommand::Dispatch(dispatch) => Some(dispatch),
            _ => None,
        });
        dispatches
            .clone()
            .for_each(|dispatch| self.push(&dispatch.work.params));
        let page = ROWS * self.stride;
        while self.pages.len() * page < self.rows.len() {
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            let made = make(gpu, "parameters", page as u64, usage)?;
            self.pages.push(made);
        }
        let mut made: Vec<Launch> = std::mem::take(&mut self.spare);
        let mut before: Option<&Dispatch<Pipeline>> = None;
        for (i, dispatch) in dispatches.enumerate() {
            let (page, row) = (i / ROWS, i % ROWS);
            // Consecutive dispatches that differ only in the offset share a bind group.
            let is_same = |before: &Dispatch<Pipeline>| {
                before.work.kernel.name == dispatch.work.kernel.name
                    && before.work.trace_index == dispatch.work.trace_index
                    && recording.buffers_of(before) == recording.buffers_of(dispatch)
            };
            let shared = row > 0 && before.is_some_and(is_same);
            let group = match made.last().filter(|_| shared) {
                Some(last) => last.group.clone(),
                None => {
                    let params = &self.pages[page];
                    let counts = &counts[dispatch.work.trace_index % counts.len()];
                    let bindings = recording.bindings_of(dispatch);
                    let buffers = bindings.map(|(_, bound)| match bound {
                        BoundBuffer::Params => params.clone(),
                        BoundBuffer::Counts => counts.clone(),
                        BoundBuffer::Recorded(buffer) => buffer.clone(),
                    });
                    self.groups
                        .get(gpu, &dispatch.pipeline, buffers.collect())?
                }
            };
            made.push(Launch {
                pipeline: dispatch.pipeline.wgpu.clone(),
                group,
                offset: (row * self.stride) as u32,
                groups: dispatch.groups,
            });
            before = Some(dispatch);
        }
        Ok(made)
    }

    /// Takes back the vector of the launches, for reuse.
    pub(crate) fn reuse(&mut self, mut launches: Vec<Launch>) {
        launches.clear();
        self.spare = launches;
    }

    /// Writes all parameters of the recording to the device.
    pub(crate) fn write(&self, gpu: &OpenGpu) -> Result<()> {
        let rows = self.rows.chunks(ROWS * self.stride);
        let mut pages = self.pages.iter().zip(rows);
        pages.try_for_each(|(page, rows)| write(gpu, page, 0, rows))
    }

    fn push(&mut self, params: &Params) {
        let at = self.rows.len();
        self.rows.extend_from_slice(bytemuck::bytes_of(params));
        self.rows.resize(at + self.stride, 0);
    }
}

/// Bind groups by kernel and buffers.
///
/// A bind group keeps its buffers alive. All are dropped once a new buffer was created, because it may replace one that
/// only a bind group still holds. In a steady state no groups are created.
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
        let is_lent = bindings.any(|b| b.name == BufferName::Lent);
        let key = (pipeline.kernel.name, buffers);
        if let Some(found) = self.made.get(&key) {
            return Ok(found.clone());
        }
        let group = bind(gpu, pipeline, &key.1)?;
        // The program may pass different buffers each time, so do not keep the group.
        if !is_lent {
            self.made.insert(key, group.clone());
        }
        Ok(group)
    }
}

/// Binds a kernel to its buffers, in the order of its bindings.
fn bind(gpu: &OpenGpu, pipeline: &Pipeline, buffers: &[Buffer]) -> Result<BindGroup> {
    let bindings = pipeline.kernel.bindings.iter().zip(buffers);
    let entries: Vec<_> = bindings
        .map(|(b, buffer)| wgpu::BindGroupEntry {
            binding: b.number,
            resource: match b.kind {
                // A single row.
                Kind::Uniform => wgpu::BindingResource::Buffer(BufferBinding {
                    buffer,
                    offset: 0,
                    size: NonZeroU64::new(size_of::<Params>() as u64),
                }),
                Kind::Read | Kind::ReadWrite => buffer.as_entire_binding(),
            },
        })
        .collect();
    let desc = wgpu::BindGroupDescriptor {
        label: Some(pipeline.kernel.name),
        layout: &pipeline.layout,
        entries: &entries,
    };
    gpu.guard(pipeline.kernel.name, 0, || {
        gpu.device.create_bind_group(&desc)
    })
}
