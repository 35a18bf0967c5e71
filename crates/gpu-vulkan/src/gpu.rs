//! The logical device and its queues.

use crate::allocator::Memory;
use crate::errors::failed;
use crate::instance::Host;
use crate::limits::{DeviceLimits, Extras};
use crate::pipeline_cache::PipelineCache;
use crate::queues::{QueueIndex, QueueSet, Queues};
use crate::sharing::{self, Import};
use ash::ext::pipeline_robustness;
use ash::{khr, vk};
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use geom::lock;
use gpu_common::{Options, device_door};
use std::ffi::CStr;
use std::sync::{Arc, Mutex};

/// A logical device with its memory, queues and limits. It is shared, and destroyed with its last user.
pub struct Gpu {
    /// Device functions.
    pub vk: ash::Device,
    pub(crate) memory: Memory,
    /// Queues, shared by all scenes.
    pub(crate) queues: QueueSet<Arc<Queue>>,
    /// Queue families that share all buffers, starting with the compute family.
    pub families: Vec<u32>,
    /// Description of the adapter.
    pub adapter: AdapterInfo,
    pub(crate) limits: DeviceLimits,
    /// Valid bits of a timestamp; 0 without a clock.
    pub(crate) timestamp_bits: u32,
    pub(crate) extras: Extras,
    /// Enabled extensions for exporting memory and semaphores, and for importing host pages.
    pub sharing: Vec<&'static CStr>,
    /// Import of host pages, if supported.
    pub(crate) import: Option<Import>,
    /// Cache of compiled kernels.
    pub cache: PipelineCache,
    /// Whether the device was opened for the driver's own trees.
    pub(crate) traces_rays: bool,
    /// The instance of the device.
    pub host: Arc<Host>,
}

/// Extensions for tracing rays through the driver's own trees.
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
        unsafe { gpu.vk.queue_wait_idle(*queue) }.map_err(failed("waiting for a queue"))
    }
}

impl Gpu {
    /// Opens one of the adapters of `list`. With `traces_rays`, enables the driver's own trees.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason, or [`BackendError::Limit`] if a limit is too low for any scene.
    pub fn open(
        host: Arc<Host>,
        list: &[AdapterInfo],
        options: &Options,
        traces_rays: bool,
    ) -> Result<Arc<Self>> {
        let adapter = AdapterInfo::choose(list, options.adapter)?.clone();
        let physical = host.physical_devices()?[adapter.index];
        let limits = DeviceLimits::of(&host, physical);
        limits.admit_kernels(|k| !k.makes_trees())?;
        let queues = Queues::find(&host, physical)?;
        let extras = Extras::of(&host, physical)?;
        let sharing = sharing::extensions(&host, physical);
        let vk = create(&host, physical, &queues, (traces_rays, extras, &sharing))?;
        let memory = match Memory::new(&host, physical, &vk, traces_rays) {
            Ok(memory) => memory,
            Err(e) => {
                // SAFETY: no object was created from the device yet.
                unsafe { vk.destroy_device(None) };
                return Err(e);
            }
        };
        let import = Import::of(&host, physical, (&vk, &sharing));
        let cache = PipelineCache::open(&host, physical, &vk, options.cache.as_deref());
        Ok(Arc::new(Self {
            queues: opened(&vk, queues.places),
            vk,
            cache,
            memory,
            families: queues.families().iter().map(|&(f, _)| f).collect(),
            adapter,
            limits,
            timestamp_bits: queues.timestamp_bits,
            extras,
            sharing,
            import,
            traces_rays,
            host,
        }))
    }

    /// Returns whether the driver runs on the host's cores.
    pub(crate) fn is_software(&self) -> bool {
        self.adapter.kind == DeviceKind::Software
    }
}

/// Opens each queue once, even if it has several purposes.
fn opened(vk: &ash::Device, places: QueueSet<QueueIndex>) -> QueueSet<Arc<Queue>> {
    let mut known: Vec<(QueueIndex, Arc<Queue>)> = Vec::new();
    let mut queue = |place: QueueIndex| match known.iter().find(|(other, _)| *other == place) {
        Some((_, queue)) => Arc::clone(queue),
        None => {
            // SAFETY: the device was created with this family and at least this many queues.
            let queue = unsafe { vk.get_device_queue(place.family, place.index) };
            let made = Arc::new(Queue {
                queue: Mutex::new(queue),
                family: place.family,
            });
            known.push((place, Arc::clone(&made)));
            made
        }
    };
    QueueSet {
        compute: queue(places.compute),
        upload: queue(places.upload),
        readback: queue(places.readback),
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: no user is left to submit work. An error means that the device is lost; there is nothing to wait for.
        let _ = unsafe { self.vk.device_wait_idle() };
        let _door = device_door();
        self.cache.close(&self.vk);
        self.memory.close();
        // SAFETY: every object created from the device holds an `Arc` of this, so all are gone.
        unsafe { self.vk.destroy_device(None) };
    }
}

fn create(
    host: &Host,
    device: vk::PhysicalDevice,
    queues: &Queues,
    (traces_rays, extras, sharing): (bool, Extras, &[&CStr]),
) -> Result<ash::Device> {
    let families = queues.families();
    let priorities = [1.0; 3];
    let asked: Vec<_> = families
        .iter()
        .map(|&(family, count)| {
            vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&priorities[..count as usize])
        })
        .collect();
    let mut want = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(true)
        .shader_buffer_int64_atomics(extras.has_least_of_64_bits)
        .buffer_device_address(traces_rays);
    let usual = vk::PhysicalDeviceFeatures::default().shader_int64(extras.has_least_of_64_bits);
    let mut structures =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut pipelines =
        vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    let mut robustness =
        vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default().pipeline_robustness(true);
    let mut extensions: Vec<_> = sharing.iter().map(|name| name.as_ptr()).collect();
    if traces_rays {
        extensions.extend(RAY_EXTENSIONS.map(CStr::as_ptr));
    }
    if extras.trusts_kernels {
        extensions.push(pipeline_robustness::NAME.as_ptr());
    }
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&asked)
        .enabled_extension_names(&extensions)
        .enabled_features(&usual)
        .push_next(&mut want);
    if traces_rays {
        info = info.push_next(&mut structures).push_next(&mut pipelines);
    }
    if extras.trusts_kernels {
        info = info.push_next(&mut robustness);
    }
    let _door = device_door();
    // SAFETY: every pointer in `info` outlives the call; the device supports the requested features.
    unsafe { host.instance.create_device(device, &info, None) }
        .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))
}
