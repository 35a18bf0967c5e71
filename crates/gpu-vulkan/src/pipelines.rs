//! Compute pipelines, with layouts derived from the kernels' bindings.

use crate::errors::{failed, refused};
use crate::gpu::Gpu;
use ash::vk;
use backend::Result;
use gpu_common::lock_compilation;
use shaders::{Kernel, Kind};
use std::sync::Arc;

/// A compiled kernel.
pub struct Pipeline {
    pub(crate) vk: vk::Pipeline,
    pub(crate) layouts: Layouts,
    gpu: Arc<Gpu>,
}

impl Pipeline {
    pub(crate) fn new(gpu: &Arc<Gpu>, kernel: &'static Kernel, spirv: &[u8]) -> Result<Self> {
        let bindings = kernel.bindings.iter();
        let bindings = bindings.map(|b| (b.number, descriptor_type(b.kind)));
        let layouts = Layouts::new(gpu, kernel.name, vk::ShaderStageFlags::COMPUTE, bindings)?;
        let vk = with_module(gpu, kernel.name, spirv, |module| {
            compile(gpu, kernel, module, layouts.pipeline)
        })?;
        Ok(Self {
            vk,
            layouts,
            gpu: Arc::clone(gpu),
        })
    }
}

/// Layouts of a pipeline.
pub struct Layouts {
    /// Layout of its one descriptor set.
    pub set: vk::DescriptorSetLayout,
    /// Layout of the pipeline. Null until it was created.
    pub pipeline: vk::PipelineLayout,
    gpu: Arc<Gpu>,
}

impl Layouts {
    /// Creates the layouts of `what`. Each binding has a number and a descriptor type and is visible to `stages`.
    pub fn new(
        gpu: &Arc<Gpu>,
        what: &str,
        stages: vk::ShaderStageFlags,
        bindings: impl Iterator<Item = (u32, vk::DescriptorType)>,
    ) -> Result<Self> {
        let binding = |(number, ty)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(number)
                .descriptor_count(1)
                .descriptor_type(ty)
                .stage_flags(stages)
        };
        let bindings: Vec<_> = bindings.map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive and `info` outlives the call.
        let set =
            unsafe { gpu.vk.create_descriptor_set_layout(&info, None) }.map_err(failed(what))?;
        let mut made = Self {
            set,
            pipeline: vk::PipelineLayout::null(),
            gpu: Arc::clone(gpu),
        };
        let sets = [set];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: as above.
        made.pipeline =
            unsafe { gpu.vk.create_pipeline_layout(&info, None) }.map_err(failed(what))?;
        Ok(made)
    }
}

/// Creates a shader module from SPIR-V and passes it to `compile`. Several threads may call this at the same time.
///
/// # Errors
/// The driver rejects the SPIR-V, or `compile` fails.
pub fn with_module<T>(
    gpu: &Gpu,
    what: &str,
    spirv: &[u8],
    compile: impl FnOnce(vk::ShaderModule) -> Result<T>,
) -> Result<T> {
    let _lock = lock_compilation();
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(spirv);
    let info = vk::ShaderModuleCreateInfo::default().code(&words);
    // SAFETY: the words are SPIR-V that the build validated.
    let module = unsafe { gpu.vk.create_shader_module(&info, None) }.map_err(refused(what))?;
    let made = compile(module);
    // SAFETY: a pipeline does not need its module after its creation.
    unsafe { gpu.vk.destroy_shader_module(module, None) };
    made
}

fn compile(
    gpu: &Gpu,
    kernel: &Kernel,
    module: vk::ShaderModule,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let name = std::ffi::CString::new(kernel.entry).expect("entry points hold no zero byte");
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module)
        .name(&name);
    let disabled = vk::PipelineRobustnessBufferBehaviorEXT::DISABLED;
    let mut robustness = vk::PipelineRobustnessCreateInfoEXT::default()
        .storage_buffers(disabled)
        .uniform_buffers(disabled);
    let mut info = vk::ComputePipelineCreateInfo::default()
        .stage(stage)
        .layout(layout);
    if gpu.features.has_pipeline_robustness {
        info = info.push_next(&mut robustness);
    }
    // SAFETY: module and layout belong to the device; all pointers outlive the call. Kernels stay within their buffers,
    // whose sizes follow from a checked tree and a checked animation, so addresses need no robustness checks.
    let made = unsafe { gpu.vk.create_compute_pipelines(gpu.cache.vk, &[info], None) };
    made.map(|p| p[0]).map_err(|(_, e)| refused(kernel.name)(e))
}

/// Returns the descriptor type of a kind of binding.
pub fn descriptor_type(kind: Kind) -> vk::DescriptorType {
    match kind {
        Kind::Uniform => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
        Kind::Read | Kind::ReadWrite => vk::DescriptorType::STORAGE_BUFFER,
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: each owner waits for its submissions before it drops its pipelines.
        unsafe { self.gpu.vk.destroy_pipeline(self.vk, None) };
    }
}

impl Drop for Layouts {
    fn drop(&mut self) {
        let vk = &self.gpu.vk;
        // SAFETY: each owner waits for its submissions before it drops its pipelines; a null handle is ignored.
        unsafe {
            vk.destroy_pipeline_layout(self.pipeline, None);
            vk.destroy_descriptor_set_layout(self.set, None);
        }
    }
}
