//! Dispatches with their bind groups, and pages of parameters.

use crate::buffers::{make, write};
use crate::gpu::Gpu;
use crate::limits::params_stride;
use crate::pipelines::Pipeline;
use crate::wgpu_device::WgpuDevice;
use backend::Result;
use gpu_common::{Dispatch, Find};
use shaders::{BufferName, Kind, Params};
use std::collections::HashMap;
use std::num::NonZeroU64;
use wgpu::{BindGroup, Buffer, BufferBinding, BufferUsages, ComputePass, ComputePipeline};

/// Rows of parameters per buffer. Buffers are added as needed.
const ROWS: usize = 64;

/// A dispatch that is ready to be recorded.
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
    groups: Groups,
    stride: usize,
    /// Parameters, to be written to the pages.
    rows: Vec<u8>,
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
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self {
            pages: Vec::new(),
            groups: Groups::default(),
            stride: params_stride(&gpu.limits) as usize,
            rows: Vec::new(),
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

    /// Starts a new recording.
    pub(crate) fn begin(&mut self, gpu: &Gpu) {
        self.groups.refresh(gpu);
        self.rows.clear();
    }

    /// Binds dispatches to their buffers. `find` returns all buffers except parameters and counts; the counts are those
    /// of the dispatch's [place](shaders::work::Work::place).
    pub(crate) fn make(
        &mut self,
        gpu: &Gpu,
        counts: &[Buffer],
        all: &[Dispatch<'_, WgpuDevice>],
        find: Find<'_, '_, Buffer>,
    ) -> Result<Vec<Launch>> {
        let first = self.rows.len() / self.stride;
        all.iter().for_each(|d| self.push(&d.work.params));
        let page = ROWS * self.stride;
        while self.pages.len() * page < self.rows.len() {
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            let made = make(gpu, "parameters", page as u64, usage)?;
            self.pages.push(made);
        }
        let mut made: Vec<Launch> = Vec::with_capacity(all.len());
        for (i, dispatch) in all.iter().enumerate() {
            let (page, row) = ((first + i) / ROWS, (first + i) % ROWS);
            let pipeline = dispatch.pipeline;
            // Consecutive dispatches that differ only in the offset share a bind group.
            let is_same = |before: &Dispatch<'_, WgpuDevice>| {
                before.pipeline.kernel.name == pipeline.kernel.name
                    && before.work.place == dispatch.work.place
            };
            let shared = i > 0 && row > 0 && is_same(&all[i - 1]);
            let group = match made.last().filter(|_| shared) {
                Some(last) => last.group.clone(),
                None => {
                    let params = &self.pages[page];
                    self.groups.get(gpu, pipeline, |name| match name {
                        BufferName::Params => params,
                        BufferName::Counts => &counts[dispatch.work.place % counts.len()],
                        other => find(other),
                    })?
                }
            };
            made.push(Launch {
                pipeline: pipeline.wgpu.clone(),
                group,
                offset: (row * self.stride) as u32,
                groups: dispatch.groups,
            });
        }
        Ok(made)
    }

    /// Writes all parameters of the recording to the device.
    pub(crate) fn write(&self, gpu: &Gpu) -> Result<()> {
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
struct Groups {
    made: HashMap<(&'static str, Vec<Buffer>), BindGroup>,
    buffers_made: u64,
}

impl Groups {
    /// Drops all bind groups if a buffer was created since the last call.
    fn refresh(&mut self, gpu: &Gpu) {
        let now = gpu.buffers_made();
        if self.buffers_made != now {
            self.made.clear();
            self.buffers_made = now;
        }
    }

    /// Returns the bind group of a kernel with its buffers.
    fn get<'a>(
        &mut self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        find: impl Fn(BufferName) -> &'a Buffer,
    ) -> Result<BindGroup> {
        let mut bindings = pipeline.kernel.bindings.iter();
        let buffers: Vec<Buffer> = bindings.clone().map(|b| find(b.name).clone()).collect();
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
fn bind(gpu: &Gpu, pipeline: &Pipeline, buffers: &[Buffer]) -> Result<BindGroup> {
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
