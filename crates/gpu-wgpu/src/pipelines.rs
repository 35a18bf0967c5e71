//! A kernel made ready, its layout read from the kernel's own bindings; and what is kept of it for the next run.
#![expect(
    unsafe_code,
    reason = "wgpu asks for trust in kernels and caches that it does not check itself"
)]

use crate::gpu::Gpu;
use backend::Result;
use gpu_common::cache_file::CacheFile;
use gpu_common::{KernelCode, compile_door};
use shaders::{Binding, Code, Kernel, Kind, Params};
use std::num::NonZeroU64;
use std::path::Path;
use wgpu::{
    AdapterInfo, BindGroupLayout, BufferBindingType, ComputePipeline, Features, ShaderModule,
    ShaderModuleDescriptor, ShaderRuntimeChecks, ShaderSource,
};

/// A kernel ready to be bound.
pub struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) wgpu: ComputePipeline,
    pub(crate) layout: BindGroupLayout,
}

impl Pipeline {
    pub(crate) fn new(gpu: &Gpu, (kernel, code): KernelCode) -> Result<Self> {
        let module = load(gpu, kernel, code)?;
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
        cache: gpu.cache.as_ref().map(PipelineCache::wgpu),
    };
    let _door = compile_door();
    gpu.device.create_compute_pipeline(&desc)
}

/// A kernel in one of its forms.
fn load(gpu: &Gpu, kernel: &Kernel, code: Code) -> Result<ShaderModule> {
    let load = || match (gpu.checks_kernels, gpu.takes_spirv()) {
        (true, _) => gpu.device.create_shader_module(wgsl(kernel, code)),
        (_, true) => pass_through(&gpu.device, kernel, code),
        (_, false) => trusted(&gpu.device, kernel, code),
    };
    gpu.guard(kernel.name, 0, load)
}

fn wgsl(kernel: &Kernel, code: Code) -> ShaderModuleDescriptor<'_> {
    ShaderModuleDescriptor {
        label: Some(kernel.name),
        source: ShaderSource::Wgsl(code.wgsl.into()),
    }
}

/// The very words that `gpu-vulkan` loads.
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
    // SAFETY: the words were validated by the build that made them; their bindings are those of the layout.
    unsafe { device.create_shader_module_passthrough(desc) }
}

fn trusted(device: &wgpu::Device, kernel: &Kernel, code: Code) -> ShaderModule {
    // Every check by name: nothing is left to a default that may change.
    let checks = ShaderRuntimeChecks {
        bounds_checks: false,
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        task_shader_dispatch_tracking: false,
        mesh_shader_primitive_indices_clamp: false,
        int_div_checks: false,
    };
    // SAFETY: kernels stay within buffers whose sizes follow from a checked record of the tree and a
    // checked animation, their loops pop a finite stack, and they divide no integers by what may be zero.
    unsafe { device.create_shader_module_trusted(wgsl(kernel, code), checks) }
}

/// wgpu's cache of pipelines, and the file that it came from.
pub(crate) struct PipelineCache {
    wgpu: wgpu::PipelineCache,
    file: CacheFile,
}

impl PipelineCache {
    /// The cache kept in a folder for this adapter and driver, where the device can keep one.
    pub(crate) fn open(
        device: &wgpu::Device,
        info: &AdapterInfo,
        folder: Option<&Path>,
    ) -> Option<Self> {
        if !device.features().contains(Features::PIPELINE_CACHE) {
            return None;
        }
        let mut file = CacheFile::new(folder?, &wgpu::util::pipeline_cache_key(info)?);
        let data = file.load();
        let desc = wgpu::PipelineCacheDescriptor {
            label: Some("abvh"),
            data: data.as_deref(),
            fallback: true,
        };
        // SAFETY: the data is what wgpu gave for this adapter, as its digest says; wgpu leaves another driver's aside.
        let wgpu = unsafe { device.create_pipeline_cache(&desc) };
        Some(Self { wgpu, file })
    }

    pub(crate) fn wgpu(&self) -> &wgpu::PipelineCache {
        &self.wgpu
    }

    /// Keeps what was added.
    pub(crate) fn store(&self) {
        let data = self.wgpu.get_data();
        data.iter().for_each(|data| self.file.store(data));
    }
}
