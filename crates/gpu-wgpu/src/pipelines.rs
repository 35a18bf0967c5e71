//! One pipeline a kernel, its layout read from the kernel's own bindings; made when a method first needs it.

use crate::device::Gpu;
use crate::modules::Modules;
use backend::{Method, Result};
use shaders::work::Work;
use shaders::{Binding, KERNELS, Kernel, Kind, Params, Traits};
use std::num::NonZeroU64;
use wgpu::{BindGroupLayout, BufferBindingType, ComputePipeline, ShaderModule};

/// Kernels ready to be bound: those that all methods share, and those of every method loaded so far.
pub(crate) struct Pipelines {
    made: Vec<Pipeline>,
    modules: Modules,
    /// Which forms of kernels the device takes; known once the first of them has run.
    pub(crate) traits: Traits,
}

pub(crate) struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) wgpu: ComputePipeline,
    pub(crate) layout: BindGroupLayout,
}

impl Pipelines {
    /// Those that all methods share.
    pub(crate) fn new(gpu: &Gpu, modules: Modules) -> Result<Self> {
        let mut pipelines = Self {
            made: Vec::new(),
            modules,
            traits: Traits::default(),
        };
        pipelines.make(gpu, |k| k.slots.is_empty() && is_usual(k))?;
        Ok(pipelines)
    }

    /// Makes what `method` needs and is not there yet.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, method: Method) -> Result<()> {
        self.make(gpu, |k| k.serves(method) && is_usual(k))
    }

    /// Makes what makes trees for `method`, if it is not there yet.
    pub(crate) fn prepare_trees(&mut self, gpu: &Gpu, method: Method) -> Result<()> {
        self.make(gpu, |k| k.makes_trees() && k.serves(method))
    }

    /// Makes what this work needs and is not there yet.
    pub(crate) fn prepare_work<'a>(
        &mut self,
        gpu: &Gpu,
        work: impl IntoIterator<Item = &'a Work>,
    ) -> Result<()> {
        for kernel in work.into_iter().map(|w| w.kernel) {
            if self.find(kernel).is_none() {
                self.make(gpu, |k| k.name == kernel.name)?;
            }
        }
        Ok(())
    }

    fn make(&mut self, gpu: &Gpu, wanted: impl Fn(&Kernel) -> bool) -> Result<()> {
        for kernel in KERNELS.iter().filter(|k| wanted(k) && k.suits(self.traits)) {
            if self.find(kernel).is_none() {
                let code = kernel.code_for(self.traits);
                let module = self.modules.load(gpu, kernel, code)?;
                self.made.push(Pipeline::new(gpu, kernel, &module)?);
            }
        }
        Ok(())
    }

    fn find(&self, kernel: &Kernel) -> Option<&Pipeline> {
        self.made.iter().find(|p| p.kernel.name == kernel.name)
    }

    pub(crate) fn get(&self, kernel: &Kernel) -> &Pipeline {
        let found = self.find(kernel);
        found.expect("pipelines are made when a method is loaded")
    }
}

/// Whether a kernel is made with the method that it serves.
fn is_usual(kernel: &Kernel) -> bool {
    !kernel.makes_trees() && !kernel.rasterizes() && !kernel.answers_extremes()
}

impl Pipeline {
    fn new(gpu: &Gpu, kernel: &'static Kernel, module: &ShaderModule) -> Result<Self> {
        gpu.guard(kernel.name, 0, || {
            let layout = bind_group_layout(gpu, kernel);
            Self {
                kernel,
                wgpu: compute_pipeline(gpu, kernel, module, &layout),
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
        cache: None,
    };
    gpu.device.create_compute_pipeline(&desc)
}
