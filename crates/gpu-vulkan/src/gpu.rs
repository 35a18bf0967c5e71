//! The logical device and its queues.

use crate::errors::failed;
use crate::external;
use crate::host_memory::Import;
use crate::instance::Host;
use crate::limits::{Extras, Limits};
use crate::memory::Memory;
use crate::pipelines::PipelineCache;
use crate::queues::{QueueIndex, QueueSet, Queues};
use ash::ext::pipeline_robustness;
use ash::{khr, vk};
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use geom::lock;
use gpu_common::{Options, device_door};
use std::ffi::CStr;
use std::sync::{Arc, Mutex};

/// A device with what every part of the backend needs of it. Shared; destroyed with the last user.
pub struct Gpu {
    /// Its calls.
    pub vk: ash::Device,
    pub(crate) memory: Memory,
    /// Scenes share them.
    pub(crate) queues: QueueSet<Arc<Queue>>,
    /// Families whose queues share all buffers, the computing one first.
    pub families: Vec<u32>,
    /// Who it is.
    pub adapter: AdapterInfo,
    pub(crate) limits: Limits,
    /// Bits of a timestamp that count; 0 without a clock.
    pub(crate) timestamp_bits: u32,
    pub(crate) extras: Extras,
    /// Extensions by which it exports memory and semaphores, and sees pages of the process.
    pub sharing: Vec<&'static CStr>,
    /// How it sees those.
    pub(crate) import: Option<Import>,
    /// Compiled kernels of earlier runs.
    pub cache: PipelineCache,
    /// Whether it was opened for trees that its driver makes.
    pub(crate) traces_rays: bool,
    /// The instance that it belongs to.
    pub host: Arc<Host>,
}

/// Extensions of a device that traces rays through its driver's trees.
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
    /// Waits until all is done that any scene submitted.
    pub(crate) fn wait_idle(&self, gpu: &Gpu) -> Result<()> {
        let queue = lock(&self.queue);
        // SAFETY: the queue belongs to the device, and nobody else uses it as long as it is locked.
        unsafe { gpu.vk.queue_wait_idle(*queue) }.map_err(failed("waiting for a queue"))
    }
}

impl Gpu {
    /// Opens the adapter asked for among some; with trees that the driver makes if it `traces_rays`.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason, or [`BackendError::Limit`] with what it lacks for any scene.
    pub fn open(
        host: Arc<Host>,
        list: &[AdapterInfo],
        options: &Options,
        traces_rays: bool,
    ) -> Result<Arc<Self>> {
        let adapter = AdapterInfo::choose(list, options.adapter)?.clone();
        let physical = host.physical_devices()?[adapter.index];
        let limits = Limits::of(&host, physical);
        limits.admit_kernels(|k| !k.makes_trees() && !k.refits_treelets())?;
        let queues = Queues::find(&host, physical)?;
        let extras = Extras::of(&host, physical)?;
        let sharing = external::extensions(&host, physical);
        let vk = create(&host, physical, &queues, (traces_rays, extras, &sharing))?;
        let memory = match Memory::new(&host, physical, &vk, traces_rays) {
            Ok(memory) => memory,
            Err(e) => {
                // SAFETY: nothing was made from the device yet.
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

    /// Whether a driver on the host's cores does the work.
    pub(crate) fn is_software(&self) -> bool {
        self.adapter.kind == DeviceKind::Software
    }
}

/// Each queue once, however many take it.
fn opened(vk: &ash::Device, places: QueueSet<QueueIndex>) -> QueueSet<Arc<Queue>> {
    let mut known: Vec<(QueueIndex, Arc<Queue>)> = Vec::new();
    let mut queue = |place: QueueIndex| match known.iter().find(|(other, _)| *other == place) {
        Some((_, queue)) => Arc::clone(queue),
        None => {
            // SAFETY: the family was asked for at creation with as many queues.
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
        // SAFETY: nobody is left who submits. A device that is lost has nothing to wait for.
        let _ = unsafe { self.vk.device_wait_idle() };
        let _door = device_door();
        self.cache.close(&self.vk);
        self.memory.close();
        // SAFETY: every object made from the device holds an `Arc` of this, so all are gone.
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
    // SAFETY: every pointer in `info` outlives the call; the features asked for are there.
    unsafe { host.instance.create_device(device, &info, None) }
        .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))
}
