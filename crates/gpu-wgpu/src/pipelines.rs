//! Compute pipelines, with layouts derived from the kernels' bindings.
#![expect(unsafe_code, reason = "wgpu does not validate these kernels")]

use crate::gpu::{OpenDevice, OpenGpu};
use crate::pipeline_cache::AdapterPipelineCache;
use backend::Result;
use gpu_common::{KernelCode, lock_compilation};
use shaders::{Binding, Code, Kernel, Kind, Params};
use std::num::NonZeroU64;
use std::sync::Arc;
use wgpu::{
    BindGroupLayout, BufferBindingType, ComputePipeline, ShaderModule, ShaderModuleDescriptor,
    ShaderRuntimeChecks, ShaderSource,
};

/// A compiled kernel.
pub struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) wgpu: ComputePipeline,
    pub(crate) layout: BindGroupLayout,
    _device: Arc<OpenDevice>,
}

impl Pipeline {
    pub(crate) fn new(gpu: &OpenGpu, (kernel, code): KernelCode) -> Result<Self> {
        let module = load(gpu, kernel, code)?;
        gpu.guard(kernel.name, 0, || {
            let layout = bind_group_layout(gpu, kernel);
            Self {
                kernel,
                wgpu: compute_pipeline(gpu, kernel, &module, &layout),
                layout,
                _device: Arc::clone(&gpu.device),
            }
        })
    }
}

fn bind_group_layout(gpu: &OpenGpu, kernel: &Kernel) -> BindGroupLayout {
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
    gpu: &OpenGpu,
    kernel: &Kernel,
    module: &wgpu::ShaderModule,
    layout: &BindGroupLayout,
) -> ComputePipeline {
    let desc = wgpu::PipelineLayoutDescriptor {
        label: Some(kernel.name),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    };
    let layout = gpu.device.create_pipeline_layout(&desc);
    let desc = wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name),
        layout: Some(&layout),
        module,
        entry_point: Some(kernel.entry),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &[],
            zero_initialize_workgroup_memory: false,
        },
        cache: gpu.cache.as_ref().map(AdapterPipelineCache::wgpu),
    };
    let _lock = lock_compilation();
    gpu.device.create_compute_pipeline(&desc)
}

/// Loads a kernel in the form that the device accepts.
fn load(gpu: &OpenGpu, kernel: &Kernel, code: Code) -> Result<ShaderModule> {
    gpu.guard(kernel.name, 0, || {
        if gpu.takes_spirv() {
            return pass_through(&gpu.device, kernel, code);
        }
        let desc = ShaderModuleDescriptor {
            label: Some(kernel.name),
            source: ShaderSource::Wgsl(code.wgsl.into()),
        };
        if gpu.uses_checked_wgsl {
            return gpu.device.create_shader_module(desc);
        }
        let checks = ShaderRuntimeChecks::unchecked();
        // SAFETY: kernels stay within their buffers, whose sizes follow from a checked tree and a checked animation.
        // No integer divisor can be zero. Every loop ends: it counts to a limit, empties a finite stack, queue, list or
        // bit mask, ascends to the root, or merges clusters, each round at least one pair.
        unsafe { gpu.device.create_shader_module_trusted(desc, checks) }
    })
}

/// Loads the same SPIR-V as `gpu-vulkan`.
fn pass_through(device: &wgpu::Device, kernel: &Kernel, code: Code) -> ShaderModule {
    let [x, y, z] = kernel.workgroup;
    let entry = wgpu::PassthroughShaderEntryPoint {
        name: kernel.entry.into(),
        workgroup_size: (x, y, z),
    };
    let desc = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(kernel.name),
        entry_points: vec![entry].into(),
        spirv: Some(bytemuck::pod_collect_to_vec(code.spirv).into()),
        ..Default::default()
    };
    // SAFETY: the build validated the words that it created; their bindings match the layout.
    unsafe { device.create_shader_module_passthrough(desc) }
}
