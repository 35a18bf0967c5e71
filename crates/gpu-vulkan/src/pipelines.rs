//! One pipeline a kernel, its layout read from the kernel's own bindings.

use crate::device::Gpu;
use crate::errors::failed;
use ash::vk;
use backend::Result;
use shaders::{KERNELS, Kernel, Kind};
use std::sync::Arc;

/// Every kernel, ready to be bound.
pub(crate) struct Pipelines {
    all: Vec<Pipeline>,
    gpu: Arc<Gpu>,
}

pub(crate) struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    pub(crate) vk: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
}

impl Pipelines {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let mut made = Self {
            all: Vec::new(),
            gpu: Arc::clone(gpu),
        };
        for kernel in KERNELS {
            let pipeline = Pipeline::new(gpu, kernel)?;
            made.all.push(pipeline);
        }
        Ok(made)
    }

    pub(crate) fn get(&self, name: &str) -> &Pipeline {
        let found = self.all.iter().find(|p| p.kernel.name == name);
        found.unwrap_or_else(|| panic!("no kernel named {name}"))
    }
}

impl Pipeline {
    fn new(gpu: &Gpu, kernel: &'static Kernel) -> Result<Self> {
        let bindings: Vec<_> = kernel
            .bindings
            .iter()
            .map(|b| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.number)
                    .descriptor_count(1)
                    .descriptor_type(descriptor_type(b.kind))
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive and `info` outlives the call; likewise below.
        let set_layout = unsafe { gpu.vk.create_descriptor_set_layout(&info, None) }
            .map_err(failed(kernel.name))?;
        let layouts = [set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        // SAFETY: as above.
        let layout =
            unsafe { gpu.vk.create_pipeline_layout(&info, None) }.map_err(failed(kernel.name))?;
        // One real driver (NVIDIA 580) offers rounding modes and then refuses kernels that
        // ask for them; the self-test judges either form.
        let nearest = gpu
            .rounds_to_nearest
            .then(|| compile(gpu, kernel, kernel.spirv_nearest, layout));
        let vk = match nearest {
            Some(Ok(pipeline)) => Ok(pipeline),
            _ => compile(gpu, kernel, kernel.spirv, layout),
        };
        Ok(Self {
            kernel,
            vk: vk?,
            layout,
            set_layout,
        })
    }
}

/// A pipeline from one form of the kernel's words.
fn compile(
    gpu: &Gpu,
    kernel: &Kernel,
    words: &[u32],
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let info = vk::ShaderModuleCreateInfo::default().code(words);
    // SAFETY: the words are SPIR-V that the build validated.
    let module =
        unsafe { gpu.vk.create_shader_module(&info, None) }.map_err(failed(kernel.name))?;
    let pipeline = create(gpu, kernel, module, layout);
    // SAFETY: pipelines do not need their module once made.
    unsafe { gpu.vk.destroy_shader_module(module, None) };
    pipeline
}

fn create(
    gpu: &Gpu,
    kernel: &Kernel,
    module: vk::ShaderModule,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let name = std::ffi::CString::new(kernel.name).expect("kernel names hold no zero byte");
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(&name);
    let info = vk::ComputePipelineCreateInfo::default()
        .stage(stage)
        .layout(layout);
    // SAFETY: module and layout belong to the device; all pointers outlive the call.
    let made = unsafe {
        gpu.vk
            .create_compute_pipelines(vk::PipelineCache::null(), &[info], None)
    };
    made.map(|p| p[0]).map_err(|(_, e)| failed(kernel.name)(e))
}

pub(crate) fn descriptor_type(kind: Kind) -> vk::DescriptorType {
    match kind {
        Kind::Uniform => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
        Kind::Read | Kind::ReadWrite => vk::DescriptorType::STORAGE_BUFFER,
    }
}

impl Drop for Pipelines {
    fn drop(&mut self) {
        for p in &self.all {
            // SAFETY: the owner waits for the device before it drops its pipelines.
            unsafe {
                self.gpu.vk.destroy_pipeline(p.vk, None);
                self.gpu.vk.destroy_pipeline_layout(p.layout, None);
                self.gpu
                    .vk
                    .destroy_descriptor_set_layout(p.set_layout, None);
            }
        }
    }
}
