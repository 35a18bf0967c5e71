//! The logical device and its queues.

use crate::allocator::Memory;
use crate::errors::{failed, failed_for};
use crate::instance::VulkanInstance;
use crate::limits::{DeviceFeatures, DeviceLimits};
use crate::pipeline_cache::PipelineCache;
use crate::queues::{QueueIndex, Queues};
use crate::sharing::Import;
use ash::ext::pipeline_robustness;
use ash::{khr, vk};
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use geom::lock;
use gpu_common::{Options, check_kernels, lock_device_lifetime};
use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::{Arc, Mutex};

/// A logical device with its memory, queues and limits. Its scenes share it; the last one destroys it.
pub struct Gpu {
    /// Device functions.
    pub vk: ash::Device,
    pub(crate) memory: Memory,
    /// Queues for compute, uploads and readbacks, shared by all scenes.
    pub(crate) queues: [Arc<Queue>; 3],
    /// Queue families that share all buffers, starting with the compute family.
    pub families: Vec<u32>,
    /// Description of the adapter.
    pub adapter: AdapterInfo,
    pub(crate) limits: DeviceLimits,
    /// Valid bits of a timestamp; 0 without a clock.
    pub(crate) timestamp_bits: u32,
    /// Optional capabilities that were enabled.
    pub features: DeviceFeatures,
    /// Import of host pages, if supported.
    pub(crate) import: Option<Import>,
    /// Cache of compiled kernels.
    pub cache: PipelineCache,
    /// The instance of the device.
    pub instance: Arc<VulkanInstance>,
}

/// Extensions for tracing rays through the driver's acceleration structures.
pub const RAY_EXTENSIONS: [&CStr; 3] = [
    khr::acceleration_structure::NAME,
    khr::ray_tracing_pipeline::NAME,
    khr::deferred_host_operations::NAME,
];

/// A queue and its family. Scenes may share it.
pub struct Queue {
    pub(crate) queue: Mutex<vk::Queue>,
    pub(crate) family: u32,
}

impl Queue {
    /// Blocks until the submissions of all scenes have finished.
    pub(crate) fn wait_idle(&self, gpu: &Gpu) -> Result<()> {
        let queue = lock(&self.queue);
        // SAFETY: the queue belongs to the device, and the lock excludes other users.
        unsafe { gpu.vk.queue_wait_idle(*queue) }.map_err(failed("a wait for a queue"))
    }
}

impl Gpu {
    /// Opens one of the adapters of `list`. With `traces_rays`, enables acceleration structures and ray tracing
    /// pipelines.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason, or [`BackendError::Limit`] if a limit is too low for any scene.
    pub fn open(
        instance: Arc<VulkanInstance>,
        list: &[AdapterInfo],
        options: &Options,
        traces_rays: bool,
    ) -> Result<Arc<Self>> {
        let adapter = AdapterInfo::choose(list, options.adapter)?.clone();
        let physical = instance.physical_devices()?[adapter.index];
        let limits = DeviceLimits::of(&instance, physical);
        check_kernels(&limits.of_kernels(), |k| !k.builds_trees())?;
        let queues = Queues::find(&instance, physical)?;
        let features = DeviceFeatures::of(&instance, physical, traces_rays)?;
        let vk = create(&instance, physical, &queues, &features)?;
        let memory = match Memory::new(&instance, physical, &vk, traces_rays) {
            Ok(memory) => memory,
            Err(e) => {
                // SAFETY: no object was created from the device yet.
                unsafe { vk.destroy_device(None) };
                return Err(e);
            }
        };
        let import = Import::of(&instance, physical, &vk, &features.sharing);
        let cache = PipelineCache::open(&instance, physical, &vk, options.cache.as_deref());
        Ok(Arc::new(Self {
            queues: opened(&vk, queues.indices),
            vk,
            cache,
            memory,
            families: queues.families().iter().map(|&(f, _)| f).collect(),
            adapter,
            limits,
            timestamp_bits: queues.timestamp_bits,
            features,
            import,
            instance,
        }))
    }

    /// Creates a buffer without memory, shared by all queue families.
    pub(crate) fn create_buffer<'a>(
        &'a self,
        what: &str,
        mut info: vk::BufferCreateInfo<'a>,
    ) -> Result<vk::Buffer> {
        if self.families.len() > 1 {
            info.sharing_mode = vk::SharingMode::CONCURRENT;
            info = info.queue_family_indices(&self.families);
        }
        // SAFETY: the device is alive; all families belong to it.
        unsafe { self.vk.create_buffer(&info, None) }.map_err(failed_for(what, info.size))
    }

    /// Returns whether the driver runs on the host's cores.
    pub(crate) fn is_software(&self) -> bool {
        self.adapter.kind == DeviceKind::Software
    }
}

/// Opens each queue once, even if it has several purposes.
fn opened(vk: &ash::Device, indices: [QueueIndex; 3]) -> [Arc<Queue>; 3] {
    let mut known = HashMap::new();
    indices.map(|index| {
        let queue = known.entry(index).or_insert_with(|| {
            // SAFETY: the device was created with this family and at least this many queues.
            let queue = unsafe { vk.get_device_queue(index.family, index.index) };
            Arc::new(Queue {
                queue: Mutex::new(queue),
                family: index.family,
            })
        });
        Arc::clone(queue)
    })
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: no user is left to submit work. An error means that the device is lost; there is nothing to wait for.
        let _ = unsafe { self.vk.device_wait_idle() };
        let _lock = lock_device_lifetime();
        self.cache.close(&self.vk);
        self.memory.close();
        // SAFETY: every object created from the device holds an `Arc` of this, so all are gone.
        unsafe { self.vk.destroy_device(None) };
    }
}

fn create(
    instance: &VulkanInstance,
    device: vk::PhysicalDevice,
    queues: &Queues,
    features: &DeviceFeatures,
) -> Result<ash::Device> {
    let families = queues.families();
    let priorities = [1.0; 3];
    let queue_infos: Vec<_> = families
        .iter()
        .map(|&(family, count)| {
            vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&priorities[..count as usize])
        })
        .collect();
    let mut core = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(true)
        .shader_buffer_int64_atomics(features.has_64_bit_atomics)
        .buffer_device_address(features.traces_rays);
    let base = vk::PhysicalDeviceFeatures::default().shader_int64(features.has_64_bit_atomics);
    let mut structures =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut pipelines =
        vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    let mut robustness =
        vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default().pipeline_robustness(true);
    let mut extensions: Vec<_> = features.sharing.iter().map(|name| name.as_ptr()).collect();
    if features.traces_rays {
        extensions.extend(RAY_EXTENSIONS.map(CStr::as_ptr));
    }
    if features.has_pipeline_robustness {
        extensions.push(pipeline_robustness::NAME.as_ptr());
    }
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queue_infos)
        .enabled_extension_names(&extensions)
        .enabled_features(&base)
        .push_next(&mut core);
    if features.traces_rays {
        info = info.push_next(&mut structures).push_next(&mut pipelines);
    }
    if features.has_pipeline_robustness {
        info = info.push_next(&mut robustness);
    }
    let _lock = lock_device_lifetime();
    // SAFETY: every pointer in `info` outlives the call; the device supports the requested features.
    unsafe { instance.vk.create_device(device, &info, None) }
        .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))
}
