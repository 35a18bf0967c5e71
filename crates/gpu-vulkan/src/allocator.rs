//! The allocator of device memory, and statistics of its use.

use crate::instance::VulkanInstance;
use ash::ext::memory_budget;
use ash::vk;
use backend::{BackendError, Result};
use geom::lock;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation};
use parking_lot::{FairMutex, FairMutexGuard};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// The device's memory, and statistics of its use.
pub(crate) struct Memory {
    /// `None` once closed, because the allocator must be dropped before the device is destroyed.
    allocator: Mutex<Option<Allocator>>,
    /// Lock for submitting to this device and for allocating and freeing its memory. Independent of
    /// [`gpu_common::lock_compilation`], which only excludes creation and destruction of devices.
    driver_lock: FairMutex<()>,
    pub(crate) physical: vk::PhysicalDevice,
    /// Bytes of buffers in device memory, except external buffers.
    held: AtomicU64,
    /// Number of buffers created so far, in any memory, except external buffers.
    made: AtomicU64,
}

impl Memory {
    pub(crate) fn new(
        instance: &VulkanInstance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        addressed: bool,
    ) -> Result<Self> {
        // Blocks start small for small scenes and double as needed. An allocation delays submissions: a block of 256
        // MiB takes 5 ms, one of 64 MiB takes 1.5 ms.
        let sizes = AllocationSizes::new(16 << 20, 4 << 20)
            .with_max_device_memblock_size(64 << 20)
            .with_max_host_memblock_size(16 << 20);
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.vk.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: addressed,
            allocation_sizes: sizes,
        })
        .map_err(|e| BackendError::NoDevice(format!("no memory allocator: {e}")))?;
        Ok(Self {
            allocator: Mutex::new(Some(allocator)),
            driver_lock: FairMutex::new(()),
            physical,
            held: AtomicU64::new(0),
            made: AtomicU64::new(0),
        })
    }

    /// Frees all memory.
    pub(crate) fn close(&self) {
        drop(lock(&self.allocator).take());
    }

    /// Returns the bytes of device memory that buffers occupy, except external buffers.
    pub(crate) fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Returns the bytes available to this process in the device-local heap that has the most. Uses the size of each
    /// heap if the driver does not report the use of memory.
    pub(crate) fn free_bytes(&self, instance: &VulkanInstance) -> Option<u64> {
        let has_budget = instance.offers(self.physical, memory_budget::NAME);
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut found = vk::PhysicalDeviceMemoryProperties2::default();
        if has_budget {
            found = found.push_next(&mut budget);
        }
        // SAFETY: the device belongs to the instance, which is alive; the structure belongs to an extension that the
        // device has.
        unsafe {
            instance
                .vk
                .get_physical_device_memory_properties2(self.physical, &mut found)
        };
        let heaps = found.memory_properties;
        let heaps = heaps.memory_heaps_as_slice().iter().enumerate();
        let local = heaps.filter(|(_, h)| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
        let free = |(i, heap): (usize, &vk::MemoryHeap)| {
            if has_budget {
                budget.heap_budget[i].saturating_sub(budget.heap_usage[i])
            } else {
                heap.size
            }
        };
        local.map(free).max()
    }

    /// Returns the number of buffers created since the device was opened, except external buffers.
    pub(crate) fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    /// Counts a buffer that was created in imported host pages.
    pub(crate) fn count_buffer(&self) {
        self.made.fetch_add(1, Ordering::Relaxed);
    }

    /// Locks submitting, allocating and freeing with a fair lock. NVIDIA's driver has its own lock, which is not fair:
    /// a thread that frees a scene would take it again for each buffer, and block submissions until the last one.
    pub(crate) fn lock_driver(&self) -> FairMutexGuard<'_, ()> {
        self.driver_lock.lock()
    }

    pub(crate) fn allocate(
        &self,
        what: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
    ) -> Result<Allocation> {
        let desc = AllocationCreateDesc {
            name: what,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let (_lock, mut allocator) = (self.lock_driver(), lock(&self.allocator));
        let allocator = allocator.as_mut();
        let allocator = allocator.expect("the allocator lives as long as the device");
        let allocation = allocator
            .allocate(&desc)
            .map_err(|e| self.refused(what, requirements.size, &e))?;
        self.made.fetch_add(1, Ordering::Relaxed);
        self.held
            .fetch_add(device_bytes(&allocation), Ordering::Relaxed);
        Ok(allocation)
    }

    fn refused(&self, what: &str, bytes: u64, why: &AllocationError) -> BackendError {
        let held = self.held();
        let what = match why {
            AllocationError::OutOfMemory => format!("{what} (with {held} bytes already allocated)"),
            other => format!("{what} ({other})"),
        };
        BackendError::OutOfMemory { what, bytes }
    }

    pub(crate) fn free(&self, allocation: Allocation) {
        self.held
            .fetch_sub(device_bytes(&allocation), Ordering::Relaxed);
        let _lock = self.lock_driver();
        if let Some(allocator) = lock(&self.allocator).as_mut() {
            // Freeing fails only for memory of another allocator.
            let _ = allocator.free(allocation);
        }
    }
}

/// Returns the bytes of an allocation in device-local memory; 0 if it is in host memory.
pub(crate) fn device_bytes(allocation: &Allocation) -> u64 {
    let local = vk::MemoryPropertyFlags::DEVICE_LOCAL;
    if allocation.memory_properties().contains(local) {
        allocation.size()
    } else {
        0
    }
}

/// Returns the usage flags of all buffers except external buffers. `traces_rays` adds those that acceleration structures
/// need.
pub(crate) fn usage(traces_rays: bool) -> vk::BufferUsageFlags {
    let kernels = vk::BufferUsageFlags::STORAGE_BUFFER
        | vk::BufferUsageFlags::UNIFORM_BUFFER
        | vk::BufferUsageFlags::TRANSFER_SRC
        | vk::BufferUsageFlags::TRANSFER_DST;
    let rays = vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
        | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR
        | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
        | vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR;
    if traces_rays { kernels | rays } else { kernels }
}
