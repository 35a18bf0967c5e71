//! A kernel made ready, its layout read from the kernel's own bindings.

use crate::errors::{failed, refused};
use crate::gpu::{Gpu, compile_door};
use ash::vk;
use backend::Result;
use shaders::{Kernel, Kind};
use std::sync::Arc;

/// A kernel ready to be bound.
pub struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    /// Null until the driver has made it; likewise the others.
    pub(crate) vk: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    gpu: Arc<Gpu>,
}

impl Pipeline {
    pub(crate) fn new(gpu: &Arc<Gpu>, kernel: &'static Kernel, spirv: &[u32]) -> Result<Self> {
        let _door = compile_door();
        let mut made = Self {
            kernel,
            vk: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            gpu: Arc::clone(gpu),
        };
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
        made.set_layout = unsafe { gpu.vk.create_descriptor_set_layout(&info, None) }
            .map_err(failed(kernel.name))?;
        let layouts = [made.set_layout];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        // SAFETY: as above.
        made.layout =
            unsafe { gpu.vk.create_pipeline_layout(&info, None) }.map_err(failed(kernel.name))?;
        made.vk = compile(gpu, kernel, spirv, made.layout)?;
        Ok(made)
    }
}

fn compile(
    gpu: &Gpu,
    kernel: &Kernel,
    spirv: &[u32],
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let info = vk::ShaderModuleCreateInfo::default().code(spirv);
    // SAFETY: the words are SPIR-V that the build validated.
    let module =
        unsafe { gpu.vk.create_shader_module(&info, None) }.map_err(refused(kernel.name))?;
    let name = std::ffi::CString::new(kernel.entry).expect("entry points hold no zero byte");
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(&name);
    let trust = vk::PipelineRobustnessBufferBehaviorEXT::DISABLED;
    let mut robustness = vk::PipelineRobustnessCreateInfoEXT::default()
        .storage_buffers(trust)
        .uniform_buffers(trust);
    let mut info = vk::ComputePipelineCreateInfo::default()
        .stage(stage)
        .layout(layout);
    if gpu.extras.trusts_kernels {
        info = info.push_next(&mut robustness);
    }
    let cache = gpu.cache.vk();
    // SAFETY: module and layout belong to the device; all pointers outlive the call. Pipelines do
    // not need their module once made. Kernels stay within buffers whose sizes follow from a checked
    // record of the tree and a checked animation, so nobody need check their addresses.
    let made = unsafe {
        let made = gpu.vk.create_compute_pipelines(cache, &[info], None);
        gpu.vk.destroy_shader_module(module, None);
        made
    };
    made.map(|p| p[0]).map_err(|(_, e)| refused(kernel.name)(e))
}

/// How Vulkan names a kind of binding.
pub fn descriptor_type(kind: Kind) -> vk::DescriptorType {
    match kind {
        Kind::Uniform => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
        Kind::Read | Kind::ReadWrite => vk::DescriptorType::STORAGE_BUFFER,
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        let (vk, layout) = (&self.gpu.vk, self.layout);
        // SAFETY: the owner waits for the device before it drops its pipelines; null is left alone.
        unsafe {
            vk.destroy_pipeline(self.vk, None);
            vk.destroy_pipeline_layout(layout, None);
            vk.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
