//! Buffers: made, mapped, grown and given back.

use crate::device::Gpu;
use crate::errors::failed;
use ash::vk;
use backend::{BackendError, Result};
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use std::sync::{Arc, PoisonError};

/// A buffer with memory of its own.
pub(crate) struct Buffer {
    pub(crate) vk: vk::Buffer,
    pub(crate) bytes: u64,
    allocation: Option<Allocation>,
    gpu: Arc<Gpu>,
}

/// Where a buffer lives.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// In device memory, invisible to the host.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

impl Buffer {
    /// At least 16 bytes, so that an empty scene has buffers to bind.
    pub(crate) fn new(gpu: &Arc<Gpu>, what: &str, bytes: u64, place: Place) -> Result<Self> {
        let bytes = bytes.max(16).next_multiple_of(16);
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let families = [gpu.compute.family, gpu.transfer.family];
        let mut info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        if gpu.has_transfer_queue() {
            info = info
                .sharing_mode(vk::SharingMode::CONCURRENT)
                .queue_family_indices(&families);
        }
        // SAFETY: the device is alive; both families belong to it.
        let buffer = unsafe { gpu.vk.create_buffer(&info, None) }.map_err(failed(what))?;
        // SAFETY: the buffer was just made from this device.
        let requirements = unsafe { gpu.vk.get_buffer_memory_requirements(buffer) };
        let mut made = Self {
            vk: buffer,
            bytes,
            allocation: None,
            gpu: Arc::clone(gpu),
        };
        let allocation = made.allocate(what, requirements, place)?;
        // SAFETY: the memory meets the buffer's requirements and is bound once.
        unsafe {
            gpu.vk
                .bind_buffer_memory(buffer, allocation.memory(), allocation.offset())
        }
        .map_err(failed(what))?;
        made.allocation = Some(allocation);
        Ok(made)
    }

    fn allocate(
        &self,
        what: &str,
        requirements: vk::MemoryRequirements,
        place: Place,
    ) -> Result<Allocation> {
        let location = match place {
            Place::Device => MemoryLocation::GpuOnly,
            Place::Upload => MemoryLocation::CpuToGpu,
            Place::Readback => MemoryLocation::GpuToCpu,
        };
        let desc = AllocationCreateDesc {
            name: what,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let mut allocator = self
            .gpu
            .allocator
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let allocator = allocator
            .as_mut()
            .expect("the allocator lives as long as the device");
        allocator
            .allocate(&desc)
            .map_err(|_| BackendError::OutOfMemory {
                what: what.to_owned(),
                bytes: requirements.size,
            })
    }

    /// What the device has written, for buffers of [`Place::Readback`].
    pub(crate) fn read<T: Pod>(&self, count: usize) -> &[T] {
        let bytes = self.allocation.as_ref().and_then(Allocation::mapped_slice);
        let bytes = bytes.expect("readback buffers are mapped");
        bytemuck::cast_slice(&bytes[..count * size_of::<T>()])
    }

    /// Writes at a byte offset, for buffers of [`Place::Upload`].
    pub(crate) fn write<T: Pod>(&mut self, at: u64, data: &[T]) {
        let bytes = self
            .allocation
            .as_mut()
            .and_then(Allocation::mapped_slice_mut);
        let bytes = bytes.expect("upload buffers are mapped");
        let data: &[u8] = bytemuck::cast_slice(data);
        bytes[at as usize..][..data.len()].copy_from_slice(data);
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: whoever drops a buffer has waited for the submissions that use it.
        unsafe { self.gpu.vk.destroy_buffer(self.vk, None) };
        let mut allocator = self
            .gpu
            .allocator
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let (Some(allocator), Some(allocation)) = (allocator.as_mut(), self.allocation.take()) {
            // Freeing fails only for memory that is not this allocator's.
            let _ = allocator.free(allocation);
        }
    }
}
