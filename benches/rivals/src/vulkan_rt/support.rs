//! Extensions, features and limits of devices that support ray-tracing pipelines.

use ash::{khr, vk};
use backend::{AdapterInfo, BackendError, Result};
use gpu_common::Validation;
use gpu_vulkan::adapters_of;
use gpu_vulkan::gpu::{Gpu, RAY_EXTENSIONS};
use gpu_vulkan::instance::VulkanInstance;
use std::sync::Arc;

/// Extension functions and limits of an opened device.
pub(crate) struct RayTracing {
    pub(crate) structures: khr::acceleration_structure::Device,
    pub(crate) pipelines: khr::ray_tracing_pipeline::Device,
    pub(crate) bounds: Bounds,
    pub(crate) gpu: Arc<Gpu>,
}

/// Limits and alignments of the driver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Bounds {
    /// Maximum number of triangles of a tree.
    pub(crate) triangles: u64,
    /// Alignment of scratch buffers, in bytes.
    pub(crate) scratch_alignment: u64,
    /// Size of a shader group handle, in bytes.
    pub(crate) handle_bytes: u64,
    /// Alignment of the shader binding table and of its handles, in bytes.
    pub(crate) table_alignment: u64,
    /// Maximum number of rays of a launch.
    pub(crate) rays: u64,
    /// Maximum number of rays of a launch along an axis.
    pub(crate) rays_per_axis: [u64; 2],
}

impl RayTracing {
    pub(crate) fn of(gpu: &Arc<Gpu>) -> Result<Arc<Self>> {
        let instance = &gpu.instance.vk;
        let physical = gpu.instance.physical_devices()?[gpu.adapter.index];
        Ok(Arc::new(Self {
            structures: khr::acceleration_structure::Device::new(instance, &gpu.vk),
            pipelines: khr::ray_tracing_pipeline::Device::new(instance, &gpu.vk),
            bounds: Bounds::of(&gpu.instance, physical),
            gpu: Arc::clone(gpu),
        }))
    }
}

impl Bounds {
    fn of(instance: &VulkanInstance, physical: vk::PhysicalDevice) -> Self {
        let mut trees = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut rays = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
        let mut all = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut trees)
            .push_next(&mut rays);
        instance.read_properties(physical, &mut all);
        let limits = all.properties.limits;
        let rays_along = |axis: usize| {
            let groups = u64::from(limits.max_compute_work_group_count[axis]);
            groups.saturating_mul(limits.max_compute_work_group_size[axis].into())
        };
        let alignment = rays
            .shader_group_base_alignment
            .max(rays.shader_group_handle_alignment);
        Self {
            triangles: trees.max_primitive_count,
            scratch_alignment: trees
                .min_acceleration_structure_scratch_offset_alignment
                .max(1)
                .into(),
            handle_bytes: rays.shader_group_handle_size.into(),
            table_alignment: alignment.max(1).into(),
            rays: rays.max_ray_dispatch_invocation_count.into(),
            rays_per_axis: [rays_along(0), rays_along(1)],
        }
    }
}

/// Returns all devices of this machine that support acceleration structures and ray-tracing pipelines.
///
/// # Errors
/// [`NoDevice`](BackendError::NoDevice) if there is no such device. For each device, the message names the
/// first extension or feature that it lacks.
pub fn ray_adapters() -> Result<Vec<AdapterInfo>> {
    ray_adapters_of(VulkanInstance::new(Validation::Off)?.as_ref(), None)
}

/// Returns the devices as [`ray_adapters`] does. If `wanted` is the index of an adapter, only that adapter is considered.
pub(crate) fn ray_adapters_of(
    instance: &VulkanInstance,
    wanted: Option<usize>,
) -> Result<Vec<AdapterInfo>> {
    let mut list = adapters_of(instance)?;
    if wanted.is_some() {
        list = vec![AdapterInfo::choose(&list, wanted)?.clone()];
    }
    let devices = instance.physical_devices()?;
    let (mut supported, mut reasons) = (Vec::new(), Vec::new());
    for mut adapter in list {
        let device = devices[adapter.index];
        match lacks(instance, device) {
            Some(what) => reasons.push(format!("{} lacks {what}", adapter.name)),
            None => {
                let bounds = Bounds::of(instance, device);
                let has_queries = instance.offers(device, khr::ray_query::NAME);
                let queries = if has_queries { "yes" } else { "no" };
                adapter.limits.extend([
                    ("max triangles of a tree", bounds.triangles.to_string()),
                    ("max rays of a launch", bounds.rays.to_string()),
                    ("ray queries", queries.to_owned()),
                ]);
                supported.push(adapter);
            }
        }
    }
    if supported.is_empty() {
        return Err(BackendError::NoDevice(reasons.join("; ")));
    }
    Ok(supported)
}

/// Returns the first required extension or feature that a device lacks, or `None` if it has all.
fn lacks(instance: &VulkanInstance, device: vk::PhysicalDevice) -> Option<String> {
    let offered = instance.offered(device, &RAY_EXTENSIONS);
    let mut needed = RAY_EXTENSIONS.into_iter();
    if let Some(name) = needed.find(|name| !offered.contains(name)) {
        return Some(name.to_string_lossy().into_owned());
    }
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut core = vk::PhysicalDeviceVulkan12Features::default();
    let mut all = vk::PhysicalDeviceFeatures2::default()
        .push_next(&mut core)
        .push_next(&mut structures)
        .push_next(&mut pipelines);
    instance.read_features(device, &mut all);
    let features = [
        (structures.acceleration_structure, "accelerationStructure"),
        (pipelines.ray_tracing_pipeline, "rayTracingPipeline"),
        (core.buffer_device_address, "bufferDeviceAddress"),
    ];
    let off = features.into_iter().find(|&(on, _)| on == vk::FALSE);
    off.map(|(_, name)| format!("feature {name}"))
}
