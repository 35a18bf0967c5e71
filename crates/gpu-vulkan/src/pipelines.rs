//! One pipeline a kernel, its layout read from the kernel's own bindings; made when a method or a tree to be made first needs it.

use crate::device::{Gpu, one_at_a_time};
use crate::errors::{failed, refused};
use ash::vk;
use backend::{Method, Result};
use shaders::work::Work;
use shaders::{KERNELS, Kernel, Kind, Traits};
use std::sync::Arc;

/// Kernels ready to be bound: those that all methods share, and those of every method loaded so far.
pub(crate) struct Pipelines {
    made: Vec<Pipeline>,
    /// Which forms of kernels the device takes; known once the first of them has run.
    pub(crate) traits: Traits,
}

pub(crate) struct Pipeline {
    pub(crate) kernel: &'static Kernel,
    /// Null until the driver has made it; likewise the others.
    pub(crate) vk: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
    gpu: Arc<Gpu>,
}

impl Pipelines {
    /// Those that all methods share.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let mut all = Self::from(Vec::new());
        all.make(gpu, |k| k.slots.is_empty() && is_usual(k))?;
        Ok(all)
    }

    /// These alone.
    pub(crate) fn of(
        gpu: &Arc<Gpu>,
        kernels: impl IntoIterator<Item = &'static Kernel>,
    ) -> Result<Self> {
        let _door = one_at_a_time();
        let all = kernels
            .into_iter()
            .map(|k| Pipeline::new(gpu, k, k.code.spirv));
        all.collect::<Result<Vec<_>>>().map(Self::from)
    }

    /// Makes what `method` needs and is not there yet.
    pub(crate) fn prepare(&mut self, gpu: &Arc<Gpu>, method: Method) -> Result<()> {
        self.make(gpu, |k| k.serves(method) && is_usual(k))
    }

    /// Makes what makes trees for `method`, if it is not there yet.
    pub(crate) fn prepare_trees(&mut self, gpu: &Arc<Gpu>, method: Method) -> Result<()> {
        self.make(gpu, |k| k.makes_trees() && k.serves(method))
    }

    /// Makes what this work needs and is not there yet.
    pub(crate) fn prepare_work<'a>(
        &mut self,
        gpu: &Arc<Gpu>,
        work: impl IntoIterator<Item = &'a Work>,
    ) -> Result<()> {
        for kernel in work.into_iter().map(|w| w.kernel) {
            if self.find(kernel).is_none() {
                self.make(gpu, |k| k.name == kernel.name)?;
            }
        }
        Ok(())
    }

    fn make(&mut self, gpu: &Arc<Gpu>, wanted: impl Fn(&Kernel) -> bool) -> Result<()> {
        let _door = one_at_a_time();
        for kernel in KERNELS.iter().filter(|k| wanted(k) && k.suits(self.traits)) {
            if self.find(kernel).is_none() {
                let code = kernel.code_for(self.traits);
                self.made.push(Pipeline::new(gpu, kernel, code.spirv)?);
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

impl From<Vec<Pipeline>> for Pipelines {
    fn from(made: Vec<Pipeline>) -> Self {
        Self {
            made,
            traits: Traits::default(),
        }
    }
}

impl Pipeline {
    fn new(gpu: &Arc<Gpu>, kernel: &'static Kernel, spirv: &[u32]) -> Result<Self> {
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
    let cache = vk::PipelineCache::null();
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

pub(crate) fn descriptor_type(kind: Kind) -> vk::DescriptorType {
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
