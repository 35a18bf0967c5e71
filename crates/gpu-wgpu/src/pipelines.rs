//! One pipeline a kernel, its layout read from the kernel's own bindings.

use crate::device::Gpu;
use crate::modules::Modules;
use backend::Result;
use shaders::{Binding, KERNELS, Kernel, Kind, Params};
use std::num::NonZeroU64;
use wgpu::{BindGroupLayout, BufferBindingType, ComputePipeline};

/// Every kernel, ready to be bound.
pub(crate) struct Pipelines(Vec<Pipeline>);

pub(crate) struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) wgpu: ComputePipeline,
    pub(crate) layout: BindGroupLayout,
}

impl Pipelines {
    pub(crate) fn new(gpu: &Gpu, modules: Modules) -> Result<Self> {
        let made: Result<_> = KERNELS
            .iter()
            .map(|k| Pipeline::new(gpu, k, modules))
            .collect();
        made.map(Self)
    }

    pub(crate) fn get(&self, kernel: &Kernel) -> &Pipeline {
        let found = self.0.iter().find(|p| p.kernel.name == kernel.name);
        found.expect("every kernel has its pipeline")
    }
}

impl Pipeline {
    fn new(gpu: &Gpu, kernel: &'static Kernel, modules: Modules) -> Result<Self> {
        let module = modules.load(gpu, kernel)?;
        gpu.guard(kernel.name, 0, || {
            let layout = bind_group_layout(gpu, kernel);
            Self {
                kernel,
                wgpu: compute_pipeline(gpu, kernel, &module, &layout),
                layout,
            }
        })
    }
}

fn bind_group_layout(gpu: &Gpu, kernel: &Kernel) -> BindGroupLayout {
    let entries: Vec<_> = kernel.bindings.iter().map(entry).collect();
    let desc = wgpu::BindGroupLayoutDescriptor {
        label: Some(kernel.name),
        entries: &entries,
    };
    gpu.device.create_bind_group_layout(&desc)
}

fn entry(binding: &Binding) -> wgpu::BindGroupLayoutEntry {
    let uniform = binding.kind == Kind::Uniform;
    wgpu::BindGroupLayoutEntry {
        binding: binding.number,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match binding.kind {
                Kind::Uniform => BufferBindingType::Uniform,
                Kind::Read => BufferBindingType::Storage { read_only: true },
                Kind::ReadWrite => BufferBindingType::Storage { read_only: false },
            },
            has_dynamic_offset: uniform,
            min_binding_size: NonZeroU64::new(size_of::<Params>() as u64).filter(|_| uniform),
        },
        count: None,
    }
}

fn compute_pipeline(
    gpu: &Gpu,
    kernel: &Kernel,
    module: &wgpu::ShaderModule,
    layout: &BindGroupLayout,
) -> ComputePipeline {
    let layout = gpu
        .device
        .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(kernel.name),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        });
    let desc = wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name),
        layout: Some(&layout),
        module,
        entry_point: Some(kernel.name),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &[],
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    };
    gpu.device.create_compute_pipeline(&desc)
}
