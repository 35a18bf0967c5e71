//! A second Vulkan device on the same GPU, in place of another interface. It imports the memory that the library
//! exports.

#![expect(unsafe_code, reason = "nothing else opens file descriptors")]

use ash::vk;
use gpu_common::{Options, Validation};
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::gpu::Gpu;
use gpu_vulkan::instance::VulkanInstance;
use gpu_vulkan::memory::{Buffer, BufferUse};
use gpu_vulkan::transfer::BufferCopy;
use gpu_vulkan::{VulkanDevice, adapters_of};
use std::cell::RefCell;
use std::os::fd::{IntoRawFd, OwnedFd};
use std::sync::Arc;

const MEMORY_FD: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;

/// Exported memory, and the parameters that its importer needs.
pub(crate) struct Exported {
    pub(crate) fd: OwnedFd,
    pub(crate) size: u64,
    pub(crate) allocation_size: u64,
    pub(crate) memory_type: u32,
}

/// Another interface to the GPU. Every operation returns only after it has finished.
pub(crate) trait Importer {
    type Memory: Copy;

    /// Opens the GPU with this UUID.
    fn open(uuid: [u8; 16]) -> Self;
    fn import(&self, exported: Exported) -> Self::Memory;
    /// Writes `bytes` at offset `at`.
    fn write(&self, to: Self::Memory, at: u64, bytes: &[u8]);
    /// Reads the first `bytes` bytes.
    fn read(&self, from: Self::Memory, bytes: usize) -> Vec<u8>;
}

pub(crate) struct OtherDevice {
    device: RefCell<VulkanDevice>,
    /// Destroyed when the device is dropped.
    imported: RefCell<Vec<(vk::Buffer, vk::DeviceMemory)>>,
    gpu: Arc<Gpu>,
}

impl OtherDevice {
    fn staging(&self, bytes: usize, place: BufferUse) -> Buffer {
        Buffer::new(&self.gpu, "staging", bytes as u64, place).unwrap()
    }

    fn copy(&self, copy: &BufferCopy) {
        let mut device = self.device.borrow_mut();
        device.readback.start(copy, &[]).unwrap();
        device.readback.wait().unwrap();
    }
}

impl Importer for OtherDevice {
    type Memory = vk::Buffer;

    fn open(uuid: [u8; 16]) -> Self {
        let instance = VulkanInstance::new(Validation::Off).unwrap();
        let list = adapters_of(&instance).unwrap();
        let gpu = Gpu::open(instance, &list, &Options::default(), false).unwrap();
        let own = ExternalMemory::new(&gpu, 16).unwrap();
        assert_eq!(own.device_uuid(), uuid, "both take the first GPU");
        Self {
            device: RefCell::new(VulkanDevice::over(&gpu).unwrap()),
            imported: RefCell::default(),
            gpu,
        }
    }

    fn import(&self, exported: Exported) -> vk::Buffer {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY_FD);
        let info = vk::BufferCreateInfo::default()
            .size(exported.size)
            .usage(usage)
            .push_next(&mut external);
        let vk = &self.gpu.vk;
        // SAFETY: the buffer has the size and usage of the exported one.
        let buffer = unsafe { vk.create_buffer(&info, None) }.unwrap();
        let mut import = vk::ImportMemoryFdInfoKHR::default()
            .handle_type(MEMORY_FD)
            .fd(exported.fd.into_raw_fd());
        let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().buffer(buffer);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(exported.allocation_size)
            .memory_type_index(exported.memory_type)
            .push_next(&mut import)
            .push_next(&mut dedicated);
        // SAFETY: the memory is the exported one, and its type and size are those of the buffer.
        let memory = unsafe {
            let memory = vk.allocate_memory(&info, None).unwrap();
            vk.bind_buffer_memory(buffer, memory, 0).unwrap();
            memory
        };
        self.imported.borrow_mut().push((buffer, memory));
        buffer
    }

    fn write(&self, to: vk::Buffer, at: u64, bytes: &[u8]) {
        let mut from = self.staging(bytes.len(), BufferUse::Upload);
        from.write(0, bytes);
        self.copy(&BufferCopy::between(from.vk, to).range(0..bytes.len() as u64, at));
    }

    fn read(&self, from: vk::Buffer, bytes: usize) -> Vec<u8> {
        let to = self.staging(bytes, BufferUse::Readback);
        self.copy(&BufferCopy::between(from, to.vk).range(0..bytes as u64, 0));
        to.read(bytes).to_vec()
    }
}

impl Drop for OtherDevice {
    fn drop(&mut self) {
        let vk = &self.gpu.vk;
        // SAFETY: all copies have finished, and this device created all of these objects.
        unsafe {
            for (buffer, memory) in self.imported.take() {
                vk.destroy_buffer(buffer, None);
                vk.free_memory(memory, None);
            }
        }
    }
}
