//! A kernel made ready, its layout read from the kernel's own bindings; and compiled kernels, kept between runs.

use crate::errors::{failed, refused};
use crate::gpu::Gpu;
use crate::instance::Host;
use ash::vk;
use backend::Result;
use gpu_common::cache_file::CacheFile;
use gpu_common::compile_door;
use shaders::{Kernel, Kind};
use std::path::Path;
use std::sync::Arc;

/// A kernel ready to be bound.
pub struct Pipeline {
    pub(crate) kernel: &'static Kernel,
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
            kernel,
            vk,
            layouts,
            gpu: Arc::clone(gpu),
        })
    }
}

/// What a pipeline is bound by.
pub struct Layouts {
    /// Of its one set.
    pub set: vk::DescriptorSetLayout,
    /// Of the pipeline. Null until the driver has made it.
    pub pipeline: vk::PipelineLayout,
    gpu: Arc<Gpu>,
}

impl Layouts {
    /// Of `what`, whose stages bind one of a type by each number.
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
        // SAFETY: the device is alive and `info` outlives the call; likewise below.
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

/// Has the driver compile SPIR-V, as one of several threads may.
///
/// # Errors
/// The driver refuses the words, or those of `compile`.
pub fn with_module<T>(
    gpu: &Gpu,
    what: &str,
    spirv: &[u8],
    compile: impl FnOnce(vk::ShaderModule) -> Result<T>,
) -> Result<T> {
    let _door = compile_door();
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(spirv);
    let info = vk::ShaderModuleCreateInfo::default().code(&words);
    // SAFETY: the words are SPIR-V that the build validated.
    let module = unsafe { gpu.vk.create_shader_module(&info, None) }.map_err(refused(what))?;
    let made = compile(module);
    // SAFETY: pipelines do not need their module once made.
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
    // SAFETY: module and layout belong to the device; all pointers outlive the call. Kernels stay within buffers whose
    // sizes follow from a checked record of the tree and a checked animation, so nobody need check their addresses.
    let made = unsafe { gpu.vk.create_compute_pipelines(gpu.cache.vk, &[info], None) };
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
        // SAFETY: each owner waits for what it had the device do before it drops its pipelines.
        unsafe { self.gpu.vk.destroy_pipeline(self.vk, None) };
    }
}

impl Drop for Layouts {
    fn drop(&mut self) {
        let vk = &self.gpu.vk;
        // SAFETY: each owner waits for what it had the device do before it drops its pipelines; null is left alone.
        unsafe {
            vk.destroy_pipeline_layout(self.pipeline, None);
            vk.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

/// The driver's cache of pipelines, and the file that it came from. It is of use and never needed: what goes wrong with it
/// goes unsaid.
pub struct PipelineCache {
    /// Its handle. Null if the driver could make none.
    pub vk: vk::PipelineCache,
    file: Option<CacheFile>,
}

impl PipelineCache {
    /// The cache kept in a folder for this device and driver; without a folder, one that is not kept.
    pub(crate) fn open(
        host: &Host,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        folder: Option<&Path>,
    ) -> Self {
        // SAFETY: the device belongs to the instance, which is alive.
        let p = unsafe { host.instance.get_physical_device_properties(physical) };
        let uuid = u128::from_be_bytes(p.pipeline_cache_uuid);
        let name = format!(
            "vulkan-{:x}-{:x}-{:x}-{uuid:032x}",
            p.vendor_id, p.device_id, p.driver_version
        );
        let mut file = folder.map(|folder| CacheFile::new(folder, &name));
        let data = file.as_mut().and_then(CacheFile::load).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the device is alive and `data` outlives the call; it is what this driver gave, as its digest says.
        let vk = unsafe { device.create_pipeline_cache(&info, None) };
        Self {
            vk: vk.unwrap_or_default(),
            file,
        }
    }

    /// Keeps what was added, and ends it.
    pub(crate) fn close(&self, device: &ash::Device) {
        if self.vk == vk::PipelineCache::null() {
            return;
        }
        if let Some(file) = &self.file {
            // SAFETY: device and cache are alive, and nobody compiles any more.
            let data = unsafe { device.get_pipeline_cache_data(self.vk) };
            data.iter().for_each(|data| file.store(data));
        }
        // SAFETY: the device is alive; pipelines do not need their cache once made.
        unsafe { device.destroy_pipeline_cache(self.vk, None) };
    }
}
