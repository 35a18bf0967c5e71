//! A second Vulkan device on the same GPU, in place of another interface. It imports the memory that the library
//! exports.

#![expect(unsafe_code, reason = "nothing else opens file descriptors")]

use ash::vk;
use gpu_common::{Options, Validation};
use gpu_vulkan::adapters_of;
use gpu_vulkan::external::ExternalMemory;
use gpu_vulkan::gpu::Gpu;
use gpu_vulkan::instance::VulkanInstance;
use gpu_vulkan::memory::{Buffer, BufferUse};
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

/// Another interface to the GPU. Every operation waits for its end.
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
    queue: vk::Queue,
    pool: vk::CommandPool,
    /// Destroyed when the device is dropped.
    imported: RefCell<Vec<(vk::Buffer, vk::DeviceMemory)>>,
    gpu: Arc<Gpu>,
}

impl OtherDevice {
    fn staging(&self, bytes: usize, place: BufferUse) -> Buffer {
        Buffer::new(&self.gpu, "staging", bytes as u64, place).unwrap()
    }

    fn copy(&self, [from, to]: [vk::Buffer; 2], region: vk::BufferCopy) {
        let (vk, begin) = (&self.gpu.vk, vk::CommandBufferBeginInfo::default());
        let new = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: both buffers are large enough and outlive the wait for the queue. No other thread uses the queue.
        unsafe {
            let commands = vk.allocate_command_buffers(&new).unwrap();
            vk.begin_command_buffer(commands[0], &begin).unwrap();
            vk.cmd_copy_buffer(commands[0], from, to, &[region]);
            vk.end_command_buffer(commands[0]).unwrap();
            let info = vk::SubmitInfo::default().command_buffers(&commands);
            let none = vk::Fence::null();
            vk.queue_submit(self.queue, &[info], none).unwrap();
            vk.queue_wait_idle(self.queue).unwrap();
        }
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
        let family = gpu.families[0];
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        // SAFETY: the device has a queue of this family.
        unsafe {
            Self {
                queue: gpu.vk.get_device_queue(family, 0),
                pool: gpu.vk.create_command_pool(&pool, None).unwrap(),
                imported: RefCell::default(),
                gpu,
            }
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
        let region = vk::BufferCopy::default().dst_offset(at);
        self.copy([from.vk, to], region.size(bytes.len() as u64));
    }

    fn read(&self, from: vk::Buffer, bytes: usize) -> Vec<u8> {
        let to = self.staging(bytes, BufferUse::Readback);
        let region = vk::BufferCopy::default().size(bytes as u64);
        self.copy([from, to.vk], region);
        to.read(bytes).to_vec()
    }
}

impl Drop for OtherDevice {
    fn drop(&mut self) {
        let vk = &self.gpu.vk;
        // SAFETY: the queue is idle, and this device created all of these objects.
        unsafe {
            for (buffer, memory) in self.imported.take() {
                vk.destroy_buffer(buffer, None);
                vk.free_memory(memory, None);
            }
            vk.destroy_command_pool(self.pool, None);
        }
    }
}
