//! The logical device, its queues and its clock.

use crate::errors::failed;
use crate::instance::{Adapter, Host};
use ash::vk;
use backend::{BackendError, Result};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use std::sync::{Arc, Mutex};

/// A device with what every part of the backend needs of it. Shared; destroyed with the last user.
pub(crate) struct Gpu {
    pub(crate) vk: ash::Device,
    /// Taken out before the device is destroyed.
    pub(crate) allocator: Mutex<Option<Allocator>>,
    pub(crate) compute: Queue,
    /// The compute queue itself where the device has no other.
    pub(crate) transfer: Queue,
    pub(crate) adapter: Adapter,
    /// Nanoseconds a tick of the device's clock.
    pub(crate) tick_ns: f64,
    /// Whether kernels may ask for rounding to nearest even.
    pub(crate) rounds_to_nearest: bool,
    pub(crate) uniform_alignment: u64,
    pub(crate) max_groups: u32,
    pub(crate) host: Host,
}

#[derive(Clone, Copy)]
pub(crate) struct Queue {
    pub(crate) queue: vk::Queue,
    pub(crate) family: u32,
}

impl Gpu {
    /// Opens the adapter that `choose` picks.
    pub(crate) fn open(
        host: Host,
        choose: impl FnOnce(&[Adapter]) -> Result<usize>,
    ) -> Result<Arc<Self>> {
        let devices = host.physical_devices()?;
        let list: Vec<_> = devices
            .iter()
            .enumerate()
            .map(|(i, &d)| host.describe(i, d))
            .collect();
        let index = choose(&list)?;
        let (physical, adapter) = (devices[index], list[index].clone());
        let families = Families::find(&host, physical)?;
        let vk = create(&host, physical, &families)?;
        // SAFETY: both families were asked for at creation with as many queues.
        let [compute, transfer] = unsafe {
            [
                Queue {
                    queue: vk.get_device_queue(families.compute, 0),
                    family: families.compute,
                },
                Queue {
                    queue: vk.get_device_queue(families.transfer, 0),
                    family: families.transfer,
                },
            ]
        };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: host.instance.clone(),
            device: vk.clone(),
            physical_device: physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        })
        .map_err(|e| BackendError::NoDevice(format!("no memory allocator: {e}")))?;
        let (limits, rounds_to_nearest) = properties(&host, physical);
        Ok(Arc::new(Self {
            vk,
            allocator: Mutex::new(Some(allocator)),
            compute,
            transfer,
            adapter,
            tick_ns: f64::from(limits.timestamp_period),
            rounds_to_nearest,
            uniform_alignment: limits.min_uniform_buffer_offset_alignment.max(16),
            max_groups: limits.max_compute_work_group_count[0],
            host,
        }))
    }

    /// Whether transfers have a queue of their own.
    pub(crate) fn has_transfer_queue(&self) -> bool {
        self.transfer.family != self.compute.family
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
        if let Ok(mut allocator) = self.allocator.lock() {
            drop(allocator.take());
        }
        // SAFETY: every object made from the device holds an `Arc` of this, so all are gone.
        unsafe { self.vk.destroy_device(None) };
    }
}

struct Families {
    compute: u32,
    transfer: u32,
}

impl Families {
    /// A compute family, and one that can do nothing but transfer, if there is one.
    fn find(host: &Host, device: vk::PhysicalDevice) -> Result<Self> {
        // SAFETY: the device belongs to the instance, which is alive.
        let all = unsafe {
            host.instance
                .get_physical_device_queue_family_properties(device)
        };
        let (compute, transfer) = (vk::QueueFlags::COMPUTE, vk::QueueFlags::TRANSFER);
        let position = |test: &dyn Fn(vk::QueueFlags) -> bool| {
            all.iter()
                .position(|f| test(f.queue_flags))
                .map(|i| i as u32)
        };
        let computing = position(&|f| f.contains(compute))
            .ok_or_else(|| BackendError::NoDevice("the device has no compute queue".into()))?;
        let graphics = vk::QueueFlags::GRAPHICS;
        let moving = position(&|f| f.contains(transfer) && !f.intersects(compute | graphics));
        Ok(Self {
            compute: computing,
            transfer: moving.unwrap_or(computing),
        })
    }
}

fn create(host: &Host, device: vk::PhysicalDevice, families: &Families) -> Result<ash::Device> {
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
    let priority = [1.0];
    let mut queues = vec![
        vk::DeviceQueueCreateInfo::default()
            .queue_family_index(families.compute)
            .queue_priorities(&priority),
    ];
    if families.transfer != families.compute {
        queues.push(
            vk::DeviceQueueCreateInfo::default()
                .queue_family_index(families.transfer)
                .queue_priorities(&priority),
        );
    }
    let mut want = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .push_next(&mut want);
    // SAFETY: every pointer in `info` outlives the call; the features asked for are there.
    unsafe { host.instance.create_device(device, &info, None) }
        .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))
}

fn properties(host: &Host, device: vk::PhysicalDevice) -> (vk::PhysicalDeviceLimits, bool) {
    let mut p12 = vk::PhysicalDeviceVulkan12Properties::default();
    let mut p = vk::PhysicalDeviceProperties2::default().push_next(&mut p12);
    // SAFETY: the device belongs to the instance, which is alive.
    unsafe {
        host.instance
            .get_physical_device_properties2(device, &mut p)
    };
    let limits = p.properties.limits;
    (limits, p12.shader_rounding_mode_rte_float32 == vk::TRUE)
}
