//! A kernel made ready, its layout read from the kernel's own bindings.

use crate::gpu::Gpu;
use crate::modules::load;
use crate::pipeline_cache::PipelineCache;
use backend::Result;
use gpu_common::{KernelCode, KernelForm, compile_door};
use shaders::{Binding, Kernel, Kind, Params};
use std::num::NonZeroU64;
use wgpu::{BindGroupLayout, BufferBindingType, ComputePipeline};

/// A kernel ready to be bound.
pub struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) wgpu: ComputePipeline,
    pub(crate) layout: BindGroupLayout,
}

impl Pipeline {
    pub(crate) fn new(gpu: &Gpu, form: KernelForm, (kernel, code): KernelCode) -> Result<Self> {
        let module = load(gpu, form, kernel, code)?;
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
        entry_point: Some(kernel.entry),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &[],
            zero_initialize_workgroup_memory: false,
        },
        cache: gpu.cache.as_ref().map(PipelineCache::wgpu),
    };
    let _door = compile_door();
    gpu.device.create_compute_pipeline(&desc)
}
