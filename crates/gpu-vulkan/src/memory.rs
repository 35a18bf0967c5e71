//! Buffers and their memory.

use crate::errors::failed_for;
use crate::external::ExternalMemory;
use crate::gpu::Gpu;
use crate::host_memory::HostMemory;
use crate::instance::Host;
use ash::ext::memory_budget;
use ash::vk;
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::{copy_in_parallel, lock};
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation};
use parking_lot::{FairMutex, FairMutexGuard};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The device's memory, and statistics of its use.
pub(crate) struct Memory {
    /// Taken before the device is destroyed.
    allocator: Mutex<Option<Allocator>>,
    /// Lock for submitting, allocating and freeing.
    turn: FairMutex<()>,
    pub(crate) physical: vk::PhysicalDevice,
    /// Bytes of buffers in device memory.
    held: AtomicU64,
    /// Number of buffers created so far, in any memory.
    made: AtomicU64,
}

impl Memory {
    pub(crate) fn new(
        host: &Host,
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
            instance: host.instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: addressed,
            allocation_sizes: sizes,
        })
        .map_err(|e| BackendError::NoDevice(format!("no memory allocator: {e}")))?;
        Ok(Self {
            allocator: Mutex::new(Some(allocator)),
            turn: FairMutex::new(()),
            physical,
            held: AtomicU64::new(0),
            made: AtomicU64::new(0),
        })
    }

    /// Frees all memory.
    pub(crate) fn close(&self) {
        drop(lock(&self.allocator).take());
    }

    /// Returns the bytes of device memory that buffers occupy.
    pub(crate) fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Returns the bytes still available to this process in the largest device-local heap. This is the heap's size if
    /// the driver does not report the use of memory.
    pub(crate) fn free_bytes(&self, host: &Host) -> Option<u64> {
        let tells = host.offers(self.physical, memory_budget::NAME);
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut found = vk::PhysicalDeviceMemoryProperties2::default();
        if tells {
            found = found.push_next(&mut budget);
        }
        // SAFETY: the device belongs to the instance, which is alive; the structure belongs to an extension that the
        // device has.
        unsafe {
            host.instance
                .get_physical_device_memory_properties2(self.physical, &mut found)
        };
        let heaps = found.memory_properties;
        let own = |i: &usize| {
            let flags = heaps.memory_heaps[*i].flags;
            flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)
        };
        let free = |i: usize| match tells {
            true => budget.heap_budget[i].saturating_sub(budget.heap_usage[i]),
            false => heaps.memory_heaps[i].size,
        };
        (0..heaps.memory_heap_count as usize)
            .filter(own)
            .map(free)
            .max()
    }

    /// Returns the number of buffers created since the device was opened.
    pub(crate) fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    /// Locks submitting, allocating and freeing, fairly. NVIDIA's driver has such a lock too, but it is not fair: a
    /// thread that frees a scene would hold it for all buffers.
    pub(crate) fn turn(&self) -> FairMutexGuard<'_, ()> {
        self.turn.lock()
    }

    fn allocate(
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
        let (_turn, mut allocator) = (self.turn(), lock(&self.allocator));
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
            AllocationError::OutOfMemory => format!("{what}, beside {held} bytes held already,"),
            other => format!("{what} ({other})"),
        };
        BackendError::OutOfMemory { what, bytes }
    }

    fn free(&self, allocation: Allocation) {
        self.held
            .fetch_sub(device_bytes(&allocation), Ordering::Relaxed);
        let _turn = self.turn();
        if let Some(allocator) = lock(&self.allocator).as_mut() {
            // Freeing fails only for memory of another allocator.
            let _ = allocator.free(allocation);
        }
    }
}

/// Returns the bytes of an allocation in device-local memory; 0 if it is in host memory.
fn device_bytes(allocation: &Allocation) -> u64 {
    let local = vk::MemoryPropertyFlags::DEVICE_LOCAL;
    match allocation.memory_properties().contains(local) {
        true => allocation.size(),
        false => 0,
    }
}

/// A buffer with its memory.
pub struct Buffer {
    /// Handle.
    pub vk: vk::Buffer,
    /// Size in bytes.
    pub bytes: u64,
    memory: BufferMemory,
    gpu: Arc<Gpu>,
}

enum BufferMemory {
    /// Part of an allocation.
    Allocated(Allocation),
    /// Imported host pages.
    Host(HostMemory),
    /// Memory that belongs to another object.
    Lent(#[expect(dead_code, reason = "it lives as long")] Arc<ExternalMemory>),
    /// No memory: not yet allocated, or already freed.
    Nothing,
}

/// Returns the usage of buffers. The driver accesses its own trees by address.
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

/// Creates a buffer without memory, shared by all queue families.
pub(crate) fn create_buffer(
    gpu: &Gpu,
    (what, bytes): (&str, u64),
    info: vk::BufferCreateInfo<'_>,
) -> Result<vk::Buffer> {
    let mut info = info.size(bytes);
    if gpu.families.len() > 1 {
        info = info
            .sharing_mode(vk::SharingMode::CONCURRENT)
            .queue_family_indices(&gpu.families);
    }
    // SAFETY: the device is alive; all families belong to it.
    unsafe { gpu.vk.create_buffer(&info, None) }.map_err(failed_for(what, bytes))
}

/// Memory and access pattern of a buffer.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum BufferUse {
    /// In device memory, not visible to the host.
    Device,
    /// Written by the host, read by kernels.
    Upload,
    /// In host memory, written by the host, copied to the device.
    Staging,
    /// Written by the device, read by the host.
    Readback,
}

impl Buffer {
    /// Creates a buffer of `bytes`, rounded up to 16 because zero-sized buffers cannot be bound.
    ///
    /// # Errors
    /// [`BackendError::Limit`] or [`BackendError::OutOfMemory`] with the required bytes.
    pub fn new(gpu: &Arc<Gpu>, what: &str, bytes: u64, place: BufferUse) -> Result<Self> {
        let bytes = bytes.max(16).next_multiple_of(16);
        gpu.limits.admit(what, bytes)?;
        if let BufferUse::Staging | BufferUse::Readback = place
            && let Some((vk, pages)) = HostMemory::buffer(gpu, (what, bytes))
        {
            gpu.memory.made.fetch_add(1, Ordering::Relaxed);
            return Ok(Self {
                vk,
                bytes,
                memory: BufferMemory::Host(pages),
                gpu: Arc::clone(gpu),
            });
        }
        let info = vk::BufferCreateInfo::default().usage(usage(gpu.traces_rays));
        let buffer = create_buffer(gpu, (what, bytes), info)?;
        // SAFETY: the buffer was just created from this device.
        let requirements = unsafe { gpu.vk.get_buffer_memory_requirements(buffer) };
        let mut made = Self {
            vk: buffer,
            bytes,
            memory: BufferMemory::Nothing,
            gpu: Arc::clone(gpu),
        };
        let location = match place {
            BufferUse::Device => MemoryLocation::GpuOnly,
            BufferUse::Upload => MemoryLocation::CpuToGpu,
            BufferUse::Staging | BufferUse::Readback => MemoryLocation::GpuToCpu,
        };
        let allocation = gpu.memory.allocate(what, requirements, location)?;
        // SAFETY: the allocation is not freed before the buffer is destroyed.
        let (memory, offset) = (unsafe { allocation.memory() }, allocation.offset());
        made.memory = BufferMemory::Allocated(allocation);
        // SAFETY: the memory meets the buffer's requirements and is bound once.
        unsafe { gpu.vk.bind_buffer_memory(buffer, memory, offset) }
            .map_err(failed_for(what, bytes))?;
        Ok(made)
    }

    /// Returns external memory of this device as a buffer of at least `bytes`.
    ///
    /// # Errors
    /// [`BackendError::Misuse`] if the memory belongs to another device or is too small.
    pub fn lent(gpu: &Arc<Gpu>, memory: &Arc<ExternalMemory>, bytes: u64) -> Result<Self> {
        if !Arc::ptr_eq(&memory.gpu, gpu) {
            let why = "the external buffer is another device's";
            return Err(BackendError::Misuse(why.into()));
        }
        if memory.bytes < bytes {
            let why = format!(
                "the external buffer has {} bytes, not {bytes}",
                memory.bytes
            );
            return Err(BackendError::Misuse(why));
        }
        Ok(Self {
            vk: memory.vk,
            bytes: memory.bytes,
            memory: BufferMemory::Lent(Arc::clone(memory)),
            gpu: Arc::clone(gpu),
        })
    }

    /// Returns whether the buffer is in imported host pages.
    pub fn is_imported(&self) -> bool {
        matches!(self.memory, BufferMemory::Host(_))
    }

    pub(crate) fn is_lent(&self) -> bool {
        matches!(self.memory, BufferMemory::Lent(_))
    }

    /// Returns the bytes of device-local memory that the buffer occupies.
    pub fn held(&self) -> u64 {
        match &self.memory {
            BufferMemory::Allocated(allocation) => device_bytes(allocation),
            _ => 0,
        }
    }

    /// Returns the device address. The device must have been opened for the driver's own trees.
    pub fn address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.vk);
        // SAFETY: the buffer has memory, and was created with the usage for device addresses.
        unsafe { self.gpu.vk.get_buffer_device_address(&info) }
    }

    /// Returns the first `count` elements of a buffer of [`BufferUse::Readback`], written by the device.
    pub fn read<T: Pod>(&self, count: usize) -> &[T] {
        let bytes = match &self.memory {
            BufferMemory::Allocated(allocation) => allocation.mapped_slice(),
            BufferMemory::Host(memory) => Some(&memory.pages[..]),
            _ => None,
        };
        let bytes = bytes.expect("readback buffers are mapped");
        bytemuck::cast_slice(&bytes[..count * size_of::<T>()])
    }

    /// Returns the contents of a buffer of [`BufferUse::Upload`] or [`BufferUse::Staging`], to be written.
    pub(crate) fn view_mut<T: Pod>(&mut self) -> &mut [T] {
        let bytes = match &mut self.memory {
            BufferMemory::Allocated(allocation) => allocation.mapped_slice_mut(),
            BufferMemory::Host(memory) => Some(&mut memory.pages[..]),
            _ => None,
        };
        let bytes = bytes.expect("upload buffers are mapped");
        let whole = self.bytes as usize / size_of::<T>() * size_of::<T>();
        bytemuck::cast_slice_mut(&mut bytes[..whole])
    }

    /// Writes the first rows with several threads, for buffers of [`BufferUse::Upload`].
    pub(crate) fn set_rows<T: Pod + Send + Sync>(&mut self, rows: &[T]) {
        copy_in_parallel(&mut self.view_mut()[..rows.len()], rows);
    }

    /// Writes at a byte offset, for buffers of [`BufferUse::Upload`] and [`BufferUse::Staging`].
    pub fn write<T: Pod + Send + Sync>(&mut self, at: u64, data: &[T]) {
        let data: &[u8] = bytemuck::cast_slice(data);
        self.view_mut()[at as usize..][..data.len()].copy_from_slice(data);
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let memory = std::mem::replace(&mut self.memory, BufferMemory::Nothing);
        if let BufferMemory::Lent(_) = memory {
            return;
        }
        // SAFETY: the owner waits for the submissions that use a buffer before it drops the buffer.
        unsafe { self.gpu.vk.destroy_buffer(self.vk, None) };
        if let BufferMemory::Allocated(allocation) = memory {
            self.gpu.memory.free(allocation);
        }
    }
}
