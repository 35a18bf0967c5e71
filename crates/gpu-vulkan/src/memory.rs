//! Buffers: made, mapped and given back.

use crate::errors::failed_for;
use crate::external::ExternalMemory;
use crate::gpu::Gpu;
use crate::host_memory::HostMemory;
use crate::instance::Host;
use ash::ext::memory_budget;
use ash::vk;
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::{lock, set_each};
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings, MemoryLocation};
use parking_lot::{FairMutex, FairMutexGuard};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The device's memory, and how much of it is in use.
pub(crate) struct Memory {
    /// Taken out before the device is destroyed.
    allocator: Mutex<Option<Allocator>>,
    /// Whose turn it is to submit, allocate or free.
    turn: FairMutex<()>,
    pub(crate) physical: vk::PhysicalDevice,
    /// Bytes of buffers in device memory.
    held: AtomicU64,
    /// Buffers made so far, wherever they lie.
    made: AtomicU64,
}

impl Memory {
    pub(crate) fn new(
        host: &Host,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        addressed: bool,
    ) -> Result<Self> {
        // Blocks begin small for small scenes and double as more are needed. While one is allocated, nobody submits:
        // a block of 256 MiB takes 5 ms, one of 64 takes 1.5.
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

    /// Gives the memory back to the driver.
    pub(crate) fn close(&self) {
        drop(lock(&self.allocator).take());
    }

    /// Bytes of device memory that buffers hold.
    pub(crate) fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Bytes of the largest heap of the device's own that this process may still have: all of it, unless the driver
    /// tells how much others use.
    pub(crate) fn free_bytes(&self, host: &Host) -> Option<u64> {
        let tells = host.offers(self.physical, memory_budget::NAME);
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut found = vk::PhysicalDeviceMemoryProperties2::default();
        if tells {
            found = found.push_next(&mut budget);
        }
        // SAFETY: the device belongs to the instance, which is alive; the structure is of an extension that it has.
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

    /// Buffers made since the device was opened.
    pub(crate) fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    /// Nobody submits, allocates or frees twice while others wait. NVIDIA's driver has a lock for that, too, but whoever frees a
    /// scene would keep it for all buffers.
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
            // Freeing fails only for memory that is not this allocator's.
            let _ = allocator.free(allocation);
        }
    }
}

/// Bytes that an allocation takes of the device's own memory.
fn device_bytes(allocation: &Allocation) -> u64 {
    let local = vk::MemoryPropertyFlags::DEVICE_LOCAL;
    match allocation.memory_properties().contains(local) {
        true => allocation.size(),
        false => 0,
    }
}

/// A buffer with its memory.
pub struct Buffer {
    /// Its handle.
    pub vk: vk::Buffer,
    /// How large it is.
    pub bytes: u64,
    memory: BufferMemory,
    gpu: Arc<Gpu>,
}

enum BufferMemory {
    /// Part of an allocation.
    Allocated(Allocation),
    /// Pages of the process.
    Host(HostMemory),
    /// Not the buffer's own.
    Lent(#[expect(dead_code, reason = "it lives as long")] Arc<ExternalMemory>),
    /// None yet, or none any more.
    Nothing,
}

/// What buffers may be used for. All of a driver's work on its trees goes by address.
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

/// A buffer without memory, which all families share.
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

/// Where a buffer lives.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum BufferUse {
    /// In device memory, invisible to the host.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the host, copied to the device: in the host's own memory.
    Staging,
    /// Written by the device, read by the host.
    Readback,
}

impl Buffer {
    /// At least 16 bytes, so that an empty scene has buffers to bind.
    ///
    /// # Errors
    /// [`BackendError::Limit`] or [`BackendError::OutOfMemory`], with the need.
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
        // SAFETY: the buffer was just made from this device.
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
    /// [`BackendError::Misuse`] if it is another device's or too small.
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

    /// Whether it lies in pages of the process that the device sees.
    pub fn is_imported(&self) -> bool {
        matches!(self.memory, BufferMemory::Host(_))
    }

    pub(crate) fn is_lent(&self) -> bool {
        matches!(self.memory, BufferMemory::Lent(_))
    }

    /// Bytes that it takes of the device's own memory.
    pub fn held(&self) -> u64 {
        match &self.memory {
            BufferMemory::Allocated(allocation) => device_bytes(allocation),
            _ => 0,
        }
    }

    /// Where the device finds it, if it traces rays through its driver's trees.
    pub fn address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.vk);
        // SAFETY: the buffer has memory; buffers of such a device may be asked for their address.
        unsafe { self.gpu.vk.get_buffer_device_address(&info) }
    }

    /// What the device has written, for buffers of [`BufferUse::Readback`].
    pub fn read<T: Pod>(&self, count: usize) -> &[T] {
        let bytes = match &self.memory {
            BufferMemory::Allocated(allocation) => allocation.mapped_slice(),
            BufferMemory::Host(memory) => Some(&memory.pages[..]),
            _ => None,
        };
        let bytes = bytes.expect("readback buffers are mapped");
        bytemuck::cast_slice(&bytes[..count * size_of::<T>()])
    }

    /// What the device will read, for buffers of [`BufferUse::Upload`] and [`BufferUse::Staging`].
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

    /// Sets the first `count` rows in parallel, for buffers of [`BufferUse::Upload`].
    pub(crate) fn set_rows<T: Pod + Send>(
        &mut self,
        count: usize,
        row: impl Fn(usize) -> T + Sync,
    ) {
        set_each(&mut self.view_mut()[..count], row);
    }

    /// Writes at a byte offset, for buffers of [`BufferUse::Upload`] and [`BufferUse::Staging`].
    pub fn write<T: Pod>(&mut self, at: u64, data: &[T]) {
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
        // SAFETY: whoever drops a buffer has waited for the submissions that use it.
        unsafe { self.gpu.vk.destroy_buffer(self.vk, None) };
        if let BufferMemory::Allocated(allocation) = memory {
            self.gpu.memory.free(allocation);
        }
    }
}
