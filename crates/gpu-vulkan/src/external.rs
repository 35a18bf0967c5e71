//! Memory and timeline semaphores, exported by opaque file descriptors to another interface to the same GPU.
//!
//! Exported buffers need no ownership transfer to `VK_QUEUE_FAMILY_EXTERNAL`. CUDA could not return the ownership, and
//! a buffer has no image layout that a transfer would preserve.

use crate::errors::{failed, failed_for};
use crate::gpu::Gpu;
use crate::sharing::{MEMORY_EXTENSION, SEMAPHORE_EXTENSION, memory_features};
use crate::timeline::Timeline;
use ash::{khr, vk};
use backend::{BackendError, BackendName, Result};
use std::ffi::CStr;
#[cfg(unix)]
use std::os::fd::{FromRawFd, OwnedFd};
use std::sync::Arc;

const MEMORY_FD: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
const SEMAPHORE_FD: vk::ExternalSemaphoreHandleTypeFlags =
    vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD;

/// Usage of exported buffers.
const USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
        | vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
        | vk::BufferUsageFlags::TRANSFER_DST.as_raw(),
);

/// A buffer in an exported dedicated allocation.
pub struct ExternalMemory {
    pub(crate) vk: vk::Buffer,
    memory: vk::DeviceMemory,
    /// Bytes of the buffer.
    pub bytes: u64,
    /// Bytes of the allocation.
    pub allocation_bytes: u64,
    /// Vulkan's index of the memory type.
    pub memory_type: u32,
    pub(crate) gpu: Arc<Gpu>,
}

impl ExternalMemory {
    /// Allocates at least `bytes` of memory, device-local if possible.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`], with the extension's name, if the device cannot export memory;
    /// [`BackendError::Limit`] or [`BackendError::OutOfMemory`] with the required bytes.
    pub fn new(gpu: &Arc<Gpu>, bytes: u64) -> Result<Self> {
        let what = "an external buffer";
        let features = memory_features(&gpu.instance, gpu.memory.physical, USAGE, MEMORY_FD);
        let is_able = features.contains(vk::ExternalMemoryFeatureFlags::EXPORTABLE);
        gpu.check_export(what, MEMORY_EXTENSION, is_able)?;
        let bytes = bytes.max(16).checked_next_multiple_of(16);
        let bytes = bytes.unwrap_or(u64::MAX);
        gpu.limits.admit(what, bytes)?;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY_FD);
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(USAGE)
            .push_next(&mut external);
        let vk = gpu.create_buffer(what, info)?;
        // SAFETY: the buffer was just created from this device.
        let needs = unsafe { gpu.vk.get_buffer_memory_requirements(vk) };
        let mut made = Self {
            vk,
            memory: vk::DeviceMemory::null(),
            bytes,
            allocation_bytes: needs.size,
            memory_type: gpu.device_local_type(needs.memory_type_bits),
            gpu: Arc::clone(gpu),
        };
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(MEMORY_FD);
        let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().buffer(vk);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(made.memory_type)
            .push_next(&mut export)
            .push_next(&mut dedicated);
        let driver_lock = gpu.memory.lock_driver();
        // SAFETY: the buffer supports this memory type; the extension is enabled.
        let memory = unsafe { gpu.vk.allocate_memory(&info, None) };
        drop(driver_lock);
        made.memory = memory.map_err(failed_for(what, needs.size))?;
        // SAFETY: the memory was allocated for this buffer and is bound once.
        unsafe { gpu.vk.bind_buffer_memory(vk, made.memory, 0) }.map_err(failed(what))?;
        Ok(made)
    }

    /// Returns a new file descriptor of the allocation. The caller owns it.
    ///
    /// # Errors
    /// [`BackendError::Rejected`] if the process has too many file descriptors.
    #[cfg(unix)]
    pub fn fd(&self) -> Result<OwnedFd> {
        let info = vk::MemoryGetFdInfoKHR::default()
            .memory(self.memory)
            .handle_type(MEMORY_FD);
        let calls = khr::external_memory_fd::Device::new(&self.gpu.instance.vk, &self.gpu.vk);
        // SAFETY: the memory was allocated with this handle type; the extension is enabled.
        let fd = unsafe { calls.get_memory_fd(&info) }.map_err(failed("a file descriptor"))?;
        // SAFETY: each call creates a descriptor that the caller owns.
        Ok(unsafe { OwnedFd::from_raw_fd(fd) })
    }

    /// Returns the UUID of the device.
    pub fn device_uuid(&self) -> [u8; 16] {
        let mut ids = vk::PhysicalDeviceIDProperties::default();
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
        let (instance, physical) = (&self.gpu.instance, self.gpu.memory.physical);
        instance.read_properties(physical, &mut chain);
        ids.device_uuid
    }
}

impl Drop for ExternalMemory {
    fn drop(&mut self) {
        let _lock = self.gpu.memory.lock_driver();
        // SAFETY: all submitted and recorded work holds an `Arc` of this until it has finished.
        unsafe {
            self.gpu.vk.destroy_buffer(self.vk, None);
            self.gpu.vk.free_memory(self.memory, None);
        }
    }
}

impl Timeline {
    /// Creates a timeline with value 0 that can be exported.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`], with the extension's name, if the device cannot export semaphores;
    /// [`BackendError::OutOfMemory`].
    pub fn exportable(gpu: &Arc<Gpu>) -> Result<Self> {
        gpu.check_export(
            "an external semaphore",
            SEMAPHORE_EXTENSION,
            can_export_timelines(gpu),
        )?;
        let export = vk::ExportSemaphoreCreateInfo::default().handle_types(SEMAPHORE_FD);
        Self::with(gpu, Some(export))
    }

    /// Returns a new file descriptor of an exportable timeline. The caller owns it.
    ///
    /// # Errors
    /// [`BackendError::Rejected`] if the process has too many file descriptors.
    #[cfg(unix)]
    pub fn fd(&self) -> Result<OwnedFd> {
        let info = vk::SemaphoreGetFdInfoKHR::default()
            .semaphore(self.at(0).0)
            .handle_type(SEMAPHORE_FD);
        let calls = khr::external_semaphore_fd::Device::new(&self.gpu.instance.vk, &self.gpu.vk);
        // SAFETY: the semaphore was created with this handle type; the extension is enabled.
        let fd = unsafe { calls.get_semaphore_fd(&info) }.map_err(failed("a file descriptor"))?;
        // SAFETY: each call creates a descriptor that the caller owns.
        Ok(unsafe { OwnedFd::from_raw_fd(fd) })
    }
}

impl Gpu {
    /// Returns an error if the extension `name` is missing or the device cannot export.
    fn check_export(&self, what: &str, name: &CStr, is_able: bool) -> Result<()> {
        if self.features.sharing.contains(&name) && is_able {
            return Ok(());
        }
        let what = format!("{what} by {}", name.to_string_lossy());
        Err(BackendError::unsupported(BackendName::Vulkan.name(), what))
    }

    /// Returns the first allowed memory type that is device-local, or the first allowed one.
    fn device_local_type(&self, allowed: u32) -> u32 {
        let (instance, physical) = (&self.instance.vk, self.memory.physical);
        // SAFETY: the device belongs to the instance, which is alive.
        let found = unsafe { instance.get_physical_device_memory_properties(physical) };
        let is_local = |&i: &u32| {
            let flags = found.memory_types[i as usize].property_flags;
            flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
        };
        let mut all = (0..found.memory_type_count).filter(|i| allowed >> i & 1 == 1);
        all.find(is_local).unwrap_or(allowed.trailing_zeros())
    }
}

fn can_export_timelines(gpu: &Gpu) -> bool {
    let mut kind =
        vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let info = vk::PhysicalDeviceExternalSemaphoreInfo::default()
        .handle_type(SEMAPHORE_FD)
        .push_next(&mut kind);
    let mut found = vk::ExternalSemaphoreProperties::default();
    let (instance, physical) = (&gpu.instance.vk, gpu.memory.physical);
    // SAFETY: the device belongs to the instance, which is alive.
    unsafe {
        instance.get_physical_device_external_semaphore_properties(physical, &info, &mut found)
    };
    let features = found.external_semaphore_features;
    features.contains(vk::ExternalSemaphoreFeatureFlags::EXPORTABLE)
}
