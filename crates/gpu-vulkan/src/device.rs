//! The logical device and its queues.

use crate::adapters::{Adapter, all};
use crate::errors::failed;
use crate::instance::Host;
use crate::limits::Limits;
use crate::memory::Memory;
use crate::queues::{Place, Queues};
use ash::vk;
use backend::{BackendError, DeviceKind, Result, choose_adapter};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A device with what every part of the backend needs of it. Shared; destroyed with the last user.
pub(crate) struct Gpu {
    pub(crate) vk: ash::Device,
    pub(crate) memory: Memory,
    pub(crate) compute: Queue,
    /// For what the host sends; another queue where the device has one.
    pub(crate) upload: Queue,
    /// For what the host fetches; likewise.
    pub(crate) readback: Queue,
    /// Families whose queues share all buffers.
    pub(crate) families: Vec<u32>,
    pub(crate) adapter: Adapter,
    pub(crate) limits: Limits,
    /// Bits of a timestamp that count; 0 without a clock.
    pub(crate) timestamp_bits: u32,
    pub(crate) host: Arc<Host>,
}

/// Held while a device is made or destroyed or its kernels are compiled: one
/// driver (NVIDIA 580) locks itself up when threads do so at the same time.
pub(crate) fn one_at_a_time() -> MutexGuard<'static, ()> {
    static DOOR: Mutex<()> = Mutex::new(());
    DOOR.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Queue {
    pub(crate) queue: vk::Queue,
    pub(crate) family: u32,
}

impl Gpu {
    /// Opens the adapter asked for: see [`choose_adapter`].
    pub(crate) fn open(host: Arc<Host>, wanted: Option<&str>) -> Result<Arc<Self>> {
        let list = all(&host)?;
        let names: Vec<_> = list.iter().map(|a| (a.name.as_str(), a.kind)).collect();
        let adapter = list[choose_adapter(&names, wanted)?].clone();
        let physical = host.physical_devices()?[adapter.index];
        let limits = Limits::of(&host, physical);
        limits.admit_kernels()?;
        let queues = Queues::find(&host, physical)?;
        let vk = create(&host, physical, &queues)?;
        let queue = |place: Place| Queue {
            // SAFETY: the family was asked for at creation with as many queues.
            queue: unsafe { vk.get_device_queue(place.family, place.index) },
            family: place.family,
        };
        let (compute, upload, readback) = (
            queue(queues.compute),
            queue(queues.upload),
            queue(queues.readback),
        );
        let memory = match Memory::new(&host, physical, &vk) {
            Ok(memory) => memory,
            Err(e) => {
                // SAFETY: nothing was made from the device yet.
                unsafe { vk.destroy_device(None) };
                return Err(e);
            }
        };
        Ok(Arc::new(Self {
            vk,
            memory,
            compute,
            upload,
            readback,
            families: queues.families().iter().map(|&(f, _)| f).collect(),
            adapter,
            limits,
            timestamp_bits: queues.timestamp_bits,
            host,
        }))
    }

    /// Whether a driver on the host's cores does the work.
    pub(crate) fn is_software(&self) -> bool {
        self.adapter.kind == DeviceKind::Software
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
        let _door = one_at_a_time();
        self.memory.close();
        // SAFETY: every object made from the device holds an `Arc` of this, so all are gone.
        unsafe { self.vk.destroy_device(None) };
    }
}

fn create(host: &Host, device: vk::PhysicalDevice, queues: &Queues) -> Result<ash::Device> {
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
    let mut want = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&asked)
        .push_next(&mut want);
    let _door = one_at_a_time();
    // SAFETY: every pointer in `info` outlives the call; the features asked for are there.
    unsafe { host.instance.create_device(device, &info, None) }
        .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))
}
