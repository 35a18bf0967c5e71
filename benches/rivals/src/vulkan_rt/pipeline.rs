//! The ray-tracing pipeline and its shader binding table.

use super::support::RayTracing;
use ash::vk;
use backend::Result;
use gpu_common::GpuDevice;
use gpu_vulkan::errors::{failed, refused};
use gpu_vulkan::memory::{Buffer, BufferUse};
use gpu_vulkan::{Layouts, VulkanDevice, descriptor_type, with_module};
use shaders::RAYS as RAY_SHADERS;
use std::ffi::CString;
use std::sync::Arc;

/// One pipeline with all shaders of [`shaders::RAYS`]: ray generation first, then miss, then hit shaders.
pub(crate) struct RayPipeline {
    /// Null until the driver has created it.
    pub(crate) vk: vk::Pipeline,
    pub(crate) layouts: Arc<Layouts>,
    table: Option<Table>,
    pub(crate) ray_tracing: Arc<RayTracing>,
}

/// Shader binding table: an aligned handle for each group.
struct Table {
    /// Owns the memory of the table.
    _buffer: Buffer,
    at: vk::DeviceAddress,
    stride: u64,
}

const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw()
        | vk::ShaderStageFlags::CLOSEST_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::MISS_KHR.as_raw(),
);

impl RayPipeline {
    pub(crate) fn new(device: &mut VulkanDevice, ray_tracing: &Arc<RayTracing>) -> Result<Self> {
        let what = "the ray-tracing pipeline";
        let tree = (
            RAY_SHADERS.scene,
            vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
        );
        let others = RAY_SHADERS.bindings.iter();
        let others = others.map(|b| (b.number, descriptor_type(b.kind)));
        let mut made = Self {
            vk: vk::Pipeline::null(),
            layouts: Arc::new(Layouts::new(
                &ray_tracing.gpu,
                what,
                STAGES,
                others.chain([tree]),
            )?),
            table: None,
            ray_tracing: Arc::clone(ray_tracing),
        };
        made.vk = with_module(
            &ray_tracing.gpu,
            "the ray-tracing shaders",
            RAY_SHADERS.spirv,
            |module| compile(ray_tracing, made.layouts.pipeline, module),
        )?;
        made.table = Some(Table::new(device, ray_tracing, made.vk)?);
        Ok(made)
    }

    /// Returns a function that records a launch of the ray generation shader `generate` over `x` columns and `y` rows.
    pub(crate) fn launch(
        &self,
        generate: &str,
        [x, y]: [u32; 2],
    ) -> impl FnOnce(vk::CommandBuffer) + Send + 'static + use<> {
        let place = RAY_SHADERS
            .generate
            .iter()
            .position(|&name| name == generate);
        let place = place.expect("the ray generation shader exists") as u64;
        let generators = RAY_SHADERS.generate.len() as u64;
        let table = self.table.as_ref().expect("the pipeline has a table");
        let region = |group: u64| {
            vk::StridedDeviceAddressRegionKHR::default()
                .device_address(table.at + group * table.stride)
                .stride(table.stride)
                .size(table.stride)
        };
        let none = vk::StridedDeviceAddressRegionKHR::default();
        let (generate, miss, hit) = (region(place), region(generators), region(generators + 1));
        let ray_tracing = Arc::clone(&self.ray_tracing);
        move |commands| {
            let pipelines = &ray_tracing.pipelines;
            // SAFETY: the command buffer is being recorded with the pipeline bound; the table holds a
            // handle for each group of the pipeline.
            unsafe {
                pipelines.cmd_trace_rays(commands, &generate, &miss, &hit, &none, x, y, 1);
            }
        }
    }
}

fn compile(
    ray_tracing: &RayTracing,
    layout: vk::PipelineLayout,
    module: vk::ShaderModule,
) -> Result<vk::Pipeline> {
    let generator = |name: &'static str| (vk::ShaderStageFlags::RAYGEN_KHR, name);
    let generators = RAY_SHADERS.generate.iter().copied().map(generator);
    let others = [
        (vk::ShaderStageFlags::MISS_KHR, "miss"),
        (vk::ShaderStageFlags::CLOSEST_HIT_KHR, "closest_hit"),
    ];
    let named = |(stage, name): (vk::ShaderStageFlags, &str)| {
        let name = CString::new(name).expect("names of shaders hold no zero byte");
        (stage, name)
    };
    let all: Vec<_> = generators.chain(others).map(named).collect();
    let stages: Vec<_> = all
        .iter()
        .map(|(stage, name)| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(*stage)
                .module(module)
                .name(name)
        })
        .collect();
    let groups: Vec<_> = all.iter().enumerate().map(|(i, s)| group(i, s.0)).collect();
    let info = vk::RayTracingPipelineCreateInfoKHR::default()
        .flags(
            vk::PipelineCreateFlags::RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_KHR
                | vk::PipelineCreateFlags::RAY_TRACING_NO_NULL_MISS_SHADERS_KHR,
        )
        .stages(&stages)
        .groups(&groups)
        .max_pipeline_ray_recursion_depth(1)
        .layout(layout);
    let (later, cache) = (vk::DeferredOperationKHR::null(), ray_tracing.gpu.cache.vk);
    let pipelines = &ray_tracing.pipelines;
    // SAFETY: module and layout belong to the device; all pointers outlive the call.
    unsafe { pipelines.create_ray_tracing_pipelines(later, cache, &[info], None) }
        .map(|p| p[0])
        .map_err(|(_, e)| refused("the ray-tracing pipeline")(e))
}

/// Returns the group of stage `i`. Each stage has its own group.
fn group<'a>(i: usize, stage: vk::ShaderStageFlags) -> vk::RayTracingShaderGroupCreateInfoKHR<'a> {
    let none = vk::RayTracingShaderGroupCreateInfoKHR::default()
        .general_shader(vk::SHADER_UNUSED_KHR)
        .closest_hit_shader(vk::SHADER_UNUSED_KHR)
        .any_hit_shader(vk::SHADER_UNUSED_KHR)
        .intersection_shader(vk::SHADER_UNUSED_KHR);
    match stage {
        vk::ShaderStageFlags::CLOSEST_HIT_KHR => none
            .ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP)
            .closest_hit_shader(i as u32),
        _ => none
            .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
            .general_shader(i as u32),
    }
}

impl Table {
    fn new(
        device: &mut VulkanDevice,
        ray_tracing: &RayTracing,
        pipeline: vk::Pipeline,
    ) -> Result<Self> {
        let (handle, alignment) = (
            ray_tracing.bounds.handle_bytes,
            ray_tracing.bounds.table_alignment,
        );
        let groups = RAY_SHADERS.generate.len() + 2;
        let bytes = handle as usize * groups;
        // SAFETY: the pipeline has the requested number of groups.
        let handles = unsafe {
            let pipelines = &ray_tracing.pipelines;
            pipelines.get_ray_tracing_shader_group_handles(pipeline, 0, groups as u32, bytes)
        }
        .map_err(failed("shader group handles"))?;
        let stride = handle.next_multiple_of(alignment);
        let size = stride * groups as u64 + alignment;
        let buffer = Buffer::new(
            &ray_tracing.gpu,
            "shader binding table",
            size,
            BufferUse::Device,
        )?;
        let begin = buffer.address();
        let at = begin.next_multiple_of(alignment);
        let mut table = vec![0_u8; buffer.bytes as usize];
        for (i, handle) in handles.chunks(handle as usize).enumerate() {
            let place = (at - begin) as usize + i * stride as usize;
            table[place..][..handle.len()].copy_from_slice(handle);
        }
        device.upload(&[(&table, &buffer)])?;
        Ok(Self {
            _buffer: buffer,
            at,
            stride,
        })
    }
}

impl Drop for RayPipeline {
    fn drop(&mut self) {
        // SAFETY: `engine`, the first field of `VulkanRt`, waits for the device when it is dropped. A null handle is
        // ignored.
        unsafe { self.ray_tracing.gpu.vk.destroy_pipeline(self.vk, None) };
    }
}
