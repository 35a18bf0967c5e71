//! Buffers and their memory.

use crate::allocator::{device_bytes, usage};
use crate::errors::failed_for;
use crate::external::ExternalMemory;
use crate::gpu::Gpu;
use crate::host_memory::HostMemory;
use ash::vk;
use backend::{BackendError, Result};
use bytemuck::Pod;
use geom::copy_in_parallel;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use gpu_common::BufferSize;
use std::sync::Arc;

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
    /// Memory that another interface shares.
    External { _memory: Arc<ExternalMemory> },
    /// No memory: not yet allocated, or already freed.
    Nothing,
}

/// Memory and access pattern of a buffer.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum BufferUse {
    /// In device memory, not visible to the host.
    Device,
    /// Written by the host, read by kernels or copies. In device memory if the host can write it directly.
    Upload,
    /// Written by the host, copied to the device. In host memory, cached if possible.
    Staging,
    /// Written by the device, read by the host. In host memory, cached if possible.
    Readback,
}

impl Buffer {
    /// Creates a buffer of `bytes`, rounded up to a positive multiple of 16. Zero-sized buffers cannot be bound.
    ///
    /// # Errors
    /// [`BackendError::Limit`] or [`BackendError::OutOfMemory`] with the required bytes.
    pub fn new(gpu: &Arc<Gpu>, what: &str, bytes: u64, place: BufferUse) -> Result<Self> {
        let bytes = bytes.max(16).next_multiple_of(16);
        gpu.limits.admit(what, bytes)?;
        if let BufferUse::Staging | BufferUse::Readback = place
            && let Some((vk, pages)) = HostMemory::buffer(gpu, what, bytes)
        {
            gpu.memory.count_buffer();
            return Ok(Self {
                vk,
                bytes,
                memory: BufferMemory::Host(pages),
                gpu: Arc::clone(gpu),
            });
        }
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(usage(gpu.features.traces_rays));
        let buffer = gpu.create_buffer(what, info)?;
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
    pub fn external(gpu: &Arc<Gpu>, memory: &Arc<ExternalMemory>, bytes: u64) -> Result<Self> {
        if !Arc::ptr_eq(&memory.gpu, gpu) {
            let why = "the external buffer belongs to another device";
            return Err(BackendError::Misuse(why.into()));
        }
        if memory.bytes < bytes {
            let why = format!(
                "the external buffer has {} bytes but needs {bytes}",
                memory.bytes
            );
            return Err(BackendError::Misuse(why));
        }
        let shared = BufferMemory::External {
            _memory: Arc::clone(memory),
        };
        Ok(Self {
            vk: memory.vk,
            bytes: memory.bytes,
            memory: shared,
            gpu: Arc::clone(gpu),
        })
    }

    /// Returns whether the buffer is in imported host pages.
    pub fn is_imported(&self) -> bool {
        matches!(self.memory, BufferMemory::Host(_))
    }

    /// Returns the bytes of device-local memory that the buffer occupies; 0 for external memory.
    pub fn held(&self) -> u64 {
        match &self.memory {
            BufferMemory::Allocated(allocation) => device_bytes(allocation),
            _ => 0,
        }
    }

    pub(crate) fn size(&self) -> BufferSize {
        BufferSize {
            bytes: self.bytes,
            allocated: self.held(),
        }
    }

    /// Returns the device address. The device must have been opened with `traces_rays`.
    pub fn address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.vk);
        // SAFETY: the buffer has memory, and was created with the usage for device addresses.
        unsafe { self.gpu.vk.get_buffer_device_address(&info) }
    }

    /// Returns the first `count` elements of a buffer of [`BufferUse::Readback`] or [`BufferUse::Staging`].
    pub fn read<T: Pod>(&self, count: usize) -> &[T] {
        let bytes = match &self.memory {
            BufferMemory::Allocated(allocation) => allocation.mapped_slice(),
            BufferMemory::Host(memory) => Some(&memory.pages[..]),
            _ => None,
        };
        let bytes = bytes.expect("the buffer is mapped");
        bytemuck::cast_slice(&bytes[..count * size_of::<T>()])
    }

    /// Returns the contents of a buffer of [`BufferUse::Upload`] or [`BufferUse::Staging`], to be written.
    pub(crate) fn view_mut<T: Pod>(&mut self) -> &mut [T] {
        let bytes = match &mut self.memory {
            BufferMemory::Allocated(allocation) => allocation.mapped_slice_mut(),
            BufferMemory::Host(memory) => Some(&mut memory.pages[..]),
            _ => None,
        };
        let bytes = bytes.expect("the buffer is mapped");
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
        if let BufferMemory::External { .. } = memory {
            return;
        }
        // SAFETY: the owner waits for the submissions that use a buffer before it drops the buffer.
        unsafe { self.gpu.vk.destroy_buffer(self.vk, None) };
        if let BufferMemory::Allocated(allocation) = memory {
            self.gpu.memory.free(allocation);
        }
    }
}
