//! The logical device and its queues.

use crate::adapters::AdapterInfo;
use crate::commands::{ALL, BUILDS, RAYS, Reach};
use crate::errors::failed;
use crate::extras::Extras;
use crate::instance::Host;
use crate::limits::Limits;
use crate::memory::Memory;
use crate::pipeline_cache::PipelineCache;
use crate::queues::{QueueIndex, Queues};
use ash::ext::pipeline_robustness;
use ash::{khr, vk};
use backend::{BackendError, DeviceKind, Result, choose_adapter};
use shaders::{Packets, Rasterization};
use std::ffi::CStr;
use std::path::Path;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A device with what every part of the backend needs of it. Shared; destroyed with the last user.
pub struct Gpu {
    /// Its calls.
    pub vk: ash::Device,
    pub(crate) memory: Memory,
    /// For frames.
    pub compute: Queue,
    /// For what the host sends; another queue where the device has one.
    pub upload: Queue,
    /// For what the host fetches; likewise.
    pub readback: Queue,
    /// Families whose queues share all buffers.
    pub(crate) families: Vec<u32>,
    /// Who it is.
    pub adapter: AdapterInfo,
    pub(crate) limits: Limits,
    /// Bits of a timestamp that count; 0 without a clock.
    pub(crate) timestamp_bits: u32,
    pub(crate) extras: Extras,
    /// All that submissions do.
    pub(crate) reach: Reach,
    /// Compiled kernels of earlier runs.
    pub cache: PipelineCache,
    /// What buffers may be used for.
    pub(crate) buffer_usage: vk::BufferUsageFlags,
    /// The instance that it belongs to.
    pub host: Arc<Host>,
}

/// What a device is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Kernels alone.
    Kernels,
    /// Trees that the driver makes, too.
    RayTracing,
}

/// Extensions of a device opened for [`Needs::RayTracing`].
pub const RAY_EXTENSIONS: [&CStr; 3] = [
    khr::acceleration_structure::NAME,
    khr::ray_tracing_pipeline::NAME,
    khr::deferred_host_operations::NAME,
];

impl Needs {
    fn reach(self) -> Reach {
        match self {
            Self::Kernels => ALL,
            Self::RayTracing => ALL.and(BUILDS).and(RAYS),
        }
    }

    /// All of a driver's work on its trees goes by address.
    fn buffer_usage(self) -> vk::BufferUsageFlags {
        let kernels = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let rays = vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR
            | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
            | vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
        match self {
            Self::Kernels => kernels,
            Self::RayTracing => kernels | rays,
        }
    }
}

/// One driver (NVIDIA 580) locks itself up when a thread makes or destroys a device while another compiles kernels.
static DOOR: RwLock<()> = RwLock::new(());

/// Held while kernels are compiled, which several threads may do at a time.
pub fn compile_door() -> RwLockReadGuard<'static, ()> {
    DOOR.read().unwrap_or_else(PoisonError::into_inner)
}

/// Held while a device is made or destroyed.
fn device_door() -> RwLockWriteGuard<'static, ()> {
    DOOR.write().unwrap_or_else(PoisonError::into_inner)
}

/// A queue and its family.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Queue {
    pub(crate) queue: vk::Queue,
    pub(crate) family: u32,
}

impl Gpu {
    /// Opens the adapter asked for among some: see [`choose_adapter`]. Compiled kernels are kept in the folder `cache`.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason, or [`BackendError::Limit`] with what it lacks for any scene.
    pub fn open(
        host: Arc<Host>,
        list: &[AdapterInfo],
        (wanted, cache): (Option<&str>, Option<&Path>),
        needs: Needs,
    ) -> Result<Arc<Self>> {
        let names: Vec<_> = list.iter().map(|a| (a.name.as_str(), a.kind)).collect();
        let adapter = list[choose_adapter(&names, wanted)?].clone();
        let physical = host.physical_devices()?[adapter.index];
        let limits = Limits::of(&host, physical);
        limits.admit_kernels(|k| !k.makes_trees() && !k.refits_treelets())?;
        let queues = Queues::find(&host, physical)?;
        let extras = Extras::of(&host, physical);
        let vk = create(&host, physical, &queues, (needs, extras))?;
        let queue = |place: QueueIndex| Queue {
            // SAFETY: the family was asked for at creation with as many queues.
            queue: unsafe { vk.get_device_queue(place.family, place.index) },
            family: place.family,
        };
        let (compute, upload, readback) = (
            queue(queues.compute),
            queue(queues.upload),
            queue(queues.readback),
        );
        let memory = match Memory::new(&host, physical, &vk, needs == Needs::RayTracing) {
            Ok(memory) => memory,
            Err(e) => {
                // SAFETY: nothing was made from the device yet.
                unsafe { vk.destroy_device(None) };
                return Err(e);
            }
        };
        let cache = PipelineCache::open(&host, physical, &vk, cache);
        Ok(Arc::new(Self {
            vk,
            cache,
            memory,
            compute,
            upload,
            readback,
            families: queues.families().iter().map(|&(f, _)| f).collect(),
            adapter,
            limits,
            timestamp_bits: queues.timestamp_bits,
            extras,
            reach: needs.reach(),
            buffer_usage: needs.buffer_usage(),
            host,
        }))
    }

    /// What dispatches' parameters are aligned to, bytes.
    #[must_use]
    pub fn uniform_alignment(&self) -> u64 {
        self.limits.uniform_alignment
    }

    /// Whether a driver on the host's cores does the work.
    pub(crate) fn is_software(&self) -> bool {
        self.adapter.kind == DeviceKind::Software
    }

    /// How invocations search together here.
    pub(crate) fn packets(&self) -> Option<Packets> {
        let subgroups = self.extras.subgroups.map(|size| (size, size));
        Packets::for_device(subgroups, self.is_software())
    }

    /// Which pictures are made triangle by triangle here.
    pub(crate) fn rasterization(&self) -> Option<Rasterization> {
        let packets = self.packets();
        Rasterization::for_device(packets.filter(|_| self.extras.has_least_of_64_bits))
    }

    /// Waits until the device has nothing left to do.
    pub(crate) fn wait_idle(&self) -> Result<()> {
        // SAFETY: the backend has one owner, so nobody else submits.
        unsafe { self.vk.device_wait_idle() }.map_err(failed("waiting for the device"))
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // A device that is lost has nothing to wait for.
        let _ = self.wait_idle();
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
    (needs, extras): (Needs, Extras),
) -> Result<ash::Device> {
    let mut have12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut have = vk::PhysicalDeviceFeatures2::default().push_next(&mut have12);
    // SAFETY: the device belongs to the instance, which is alive.
    unsafe {
        host.instance
            .get_physical_device_features2(device, &mut have)
    };
    if have12.timeline_semaphore == vk::FALSE {
        return Err(BackendError::NoDevice(
            "the device has no timeline semaphores (Vulkan 1.2)".into(),
        ));
    }
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
    let traces = needs == Needs::RayTracing;
    let mut want = vk::PhysicalDeviceVulkan12Features::default()
        .timeline_semaphore(true)
        .shader_buffer_int64_atomics(extras.has_least_of_64_bits)
        .buffer_device_address(traces);
    let usual = vk::PhysicalDeviceFeatures::default().shader_int64(extras.has_least_of_64_bits);
    let mut structures =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut pipelines =
        vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    let mut robustness =
        vk::PhysicalDevicePipelineRobustnessFeaturesEXT::default().pipeline_robustness(true);
    let mut extensions = Vec::new();
    if traces {
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
    if traces {
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
