//! Another device of Vulkan's on the same GPU: what another interface would be. It imports what the library exports.

#![expect(unsafe_code, reason = "nothing else opens file descriptors")]

use ash::{khr, vk};
use gpu_common::Validation;
use gpu_vulkan::instance::Host;
use std::cell::RefCell;
use std::ffi::CStr;
use std::os::fd::{IntoRawFd, OwnedFd};
use std::sync::Arc;

const MEMORY_FD: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;

/// What an import has to be told.
pub(crate) struct Exported {
    pub(crate) fd: OwnedFd,
    pub(crate) size: u64,
    pub(crate) allocation_size: u64,
    pub(crate) memory_type: u32,
}

/// Another interface to the GPU.
pub(crate) trait Importer {
    type Memory: Copy;
    type Semaphore: Copy;

    /// Opens the GPU of that UUID.
    fn open(uuid: [u8; 16]) -> Self;
    fn import(&self, exported: Exported) -> Self::Memory;
    fn import_semaphore(&self, fd: OwnedFd) -> Self::Semaphore;
    /// Writes at a byte. Begins to, where it is said `when`, and spoils what was there first; else waits until it is done.
    fn write(&self, to: Self::Memory, at: u64, bytes: &[u8], when: Option<When<Self::Semaphore>>);
    /// The first so many bytes, read now.
    fn read(&self, from: Self::Memory, bytes: usize) -> Vec<u8>;
    /// Waits ten seconds at most; says whether the value was reached. If not, nobody waits for one any more.
    fn reaches(&self, semaphore: Self::Semaphore, value: u64) -> bool;
}

/// A timeline, the value that is waited for, and the one that is reached thereafter.
pub(crate) type When<S> = (S, [u64; 2]);

/// A buffer and its memory.
#[derive(Clone, Copy)]
pub(crate) struct Bytes(vk::Buffer, vk::DeviceMemory);

pub(crate) struct OtherDevice {
    vk: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    physical: vk::PhysicalDevice,
    /// Destroyed with it.
    made: RefCell<Vec<Bytes>>,
    semaphores: RefCell<Vec<vk::Semaphore>>,
    host: Arc<Host>,
}

impl OtherDevice {
    fn bind(&self, buffer: vk::Buffer, info: &vk::MemoryAllocateInfo<'_>) -> Bytes {
        // SAFETY: the type and the size are the buffer's.
        let memory = unsafe {
            let memory = self.vk.allocate_memory(info, None).unwrap();
            self.vk.bind_buffer_memory(buffer, memory, 0).unwrap();
            memory
        };
        let made = Bytes(buffer, memory);
        self.made.borrow_mut().push(made);
        made
    }

    /// Memory that the host sees, with so many bytes.
    fn staging(&self, bytes: u64) -> (Bytes, *mut u8) {
        let info = buffer(bytes);
        // SAFETY: the device belongs to the instance; the memory is mapped until it is freed.
        unsafe {
            let buffer = self.vk.create_buffer(&info, None).unwrap();
            let needs = self.vk.get_buffer_memory_requirements(buffer);
            let types = self
                .host
                .instance
                .get_physical_device_memory_properties(self.physical);
            let seen =
                vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let fits = |i: &u32| {
                let flags = types.memory_types[*i as usize].property_flags;
                needs.memory_type_bits >> i & 1 == 1 && flags.contains(seen)
            };
            let info = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index((0..types.memory_type_count).find(fits).unwrap());
            let made = self.bind(buffer, &info);
            let none = vk::MemoryMapFlags::empty();
            let at = self.vk.map_memory(made.1, 0, vk::WHOLE_SIZE, none);
            (made, at.unwrap().cast())
        }
    }

    fn copy(
        &self,
        [from, to]: [Bytes; 2],
        region: vk::BufferCopy,
        when: Option<When<vk::Semaphore>>,
    ) {
        let (semaphores, waits, signals) = match when {
            Some((semaphore, [wait, signal])) => (vec![semaphore], vec![wait], vec![signal]),
            None => Default::default(),
        };
        let mut values = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&waits)
            .signal_semaphore_values(&signals);
        let stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; semaphores.len()];
        let begin = vk::CommandBufferBeginInfo::default();
        let new = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: all buffers hold the bytes, and live until the device is idle.
        unsafe {
            let commands = self.vk.allocate_command_buffers(&new).unwrap();
            self.vk.begin_command_buffer(commands[0], &begin).unwrap();
            for _ in 0..if when.is_some() { 500 } else { 0 } {
                self.vk
                    .cmd_fill_buffer(commands[0], to.0, 0, vk::WHOLE_SIZE, u32::MAX);
                self.barrier(commands[0]);
            }
            self.vk
                .cmd_copy_buffer(commands[0], from.0, to.0, &[region]);
            self.vk.end_command_buffer(commands[0]).unwrap();
            let info = vk::SubmitInfo::default()
                .command_buffers(&commands)
                .wait_semaphores(&semaphores)
                .wait_dst_stage_mask(&stages)
                .signal_semaphores(&semaphores)
                .push_next(&mut values);
            let none = vk::Fence::null();
            self.vk.queue_submit(self.queue, &[info], none).unwrap();
            if when.is_none() {
                self.vk.queue_wait_idle(self.queue).unwrap();
            }
        }
    }

    fn barrier(&self, commands: vk::CommandBuffer) {
        let copies = vk::PipelineStageFlags::TRANSFER;
        let writes = vk::AccessFlags::TRANSFER_WRITE;
        let memory = [vk::MemoryBarrier::default()
            .src_access_mask(writes)
            .dst_access_mask(writes)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the commands are being recorded.
        unsafe {
            self.vk
                .cmd_pipeline_barrier(commands, copies, copies, none, &memory, &[], &[]);
        }
    }
}

impl Importer for OtherDevice {
    type Memory = Bytes;
    type Semaphore = vk::Semaphore;

    fn open(uuid: [u8; 16]) -> Self {
        let host = Host::new(Validation::Off).unwrap();
        let is_same = |&device: &vk::PhysicalDevice| {
            let mut ids = vk::PhysicalDeviceIDProperties::default();
            let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
            host.read_properties(device, &mut chain);
            ids.device_uuid == uuid
        };
        let all = host.physical_devices().unwrap();
        let physical = all.into_iter().find(is_same).unwrap();
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let wanted = [
            khr::external_memory_fd::NAME,
            khr::external_semaphore_fd::NAME,
        ];
        let offered = wanted.into_iter();
        let names = offered.filter(|name| host.offers(physical, name));
        let names: Vec<_> = names.map(CStr::as_ptr).collect();
        let mut timelines = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .push_next(&mut timelines);
        // SAFETY: what is asked for is there, and every pointer outlives the calls; all below is of this device.
        unsafe {
            let vk = host.instance.create_device(physical, &info, None).unwrap();
            let pool = vk::CommandPoolCreateInfo::default();
            Self {
                queue: vk.get_device_queue(0, 0),
                pool: vk.create_command_pool(&pool, None).unwrap(),
                vk,
                physical,
                made: RefCell::default(),
                semaphores: RefCell::default(),
                host,
            }
        }
    }

    fn import(&self, exported: Exported) -> Bytes {
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY_FD);
        let info = buffer(exported.size).push_next(&mut external);
        // SAFETY: the buffer is as the exported one is; likewise its memory.
        let buffer = unsafe { self.vk.create_buffer(&info, None) }.unwrap();
        let mut import = vk::ImportMemoryFdInfoKHR::default()
            .handle_type(MEMORY_FD)
            .fd(exported.fd.into_raw_fd());
        let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().buffer(buffer);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(exported.allocation_size)
            .memory_type_index(exported.memory_type)
            .push_next(&mut import)
            .push_next(&mut dedicated);
        self.bind(buffer, &info)
    }

    fn import_semaphore(&self, fd: OwnedFd) -> vk::Semaphore {
        let mut kind =
            vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let calls = khr::external_semaphore_fd::Device::new(&self.host.instance, &self.vk);
        // SAFETY: the descriptor is of a timeline on this GPU, and is given over.
        unsafe {
            let made = self.vk.create_semaphore(&info, None).unwrap();
            self.semaphores.borrow_mut().push(made);
            let info = vk::ImportSemaphoreFdInfoKHR::default()
                .semaphore(made)
                .handle_type(vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD)
                .fd(fd.into_raw_fd());
            calls.import_semaphore_fd(&info).unwrap();
            made
        }
    }

    fn write(&self, to: Bytes, at: u64, bytes: &[u8], when: Option<When<vk::Semaphore>>) {
        let (from, seen) = self.staging(bytes.len() as u64);
        // SAFETY: there is room for as many bytes.
        unsafe { seen.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
        let region = vk::BufferCopy::default()
            .dst_offset(at)
            .size(bytes.len() as u64);
        self.copy([from, to], region, when);
    }

    fn read(&self, from: Bytes, bytes: usize) -> Vec<u8> {
        let (to, seen) = self.staging(bytes as u64);
        let region = vk::BufferCopy::default().size(bytes as u64);
        self.copy([from, to], region, None);
        // SAFETY: as many bytes were copied there.
        unsafe { std::slice::from_raw_parts(seen, bytes) }.to_vec()
    }

    fn reaches(&self, semaphore: vk::Semaphore, value: u64) -> bool {
        let (semaphores, values) = ([semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default()
            .semaphores(&semaphores)
            .values(&values);
        let release = vk::SemaphoreSignalInfo::default()
            .semaphore(semaphore)
            .value(value + 1000);
        // SAFETY: the semaphore is this device's.
        unsafe {
            let is_reached = self.vk.wait_semaphores(&info, 10_000_000_000).is_ok();
            if !is_reached {
                self.vk.signal_semaphore(&release).unwrap();
            }
            is_reached
        }
    }
}

fn buffer(bytes: u64) -> vk::BufferCreateInfo<'static> {
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER
        | vk::BufferUsageFlags::TRANSFER_SRC
        | vk::BufferUsageFlags::TRANSFER_DST;
    vk::BufferCreateInfo::default().size(bytes).usage(usage)
}

impl Drop for OtherDevice {
    fn drop(&mut self) {
        // SAFETY: nothing is under way, and all was made by this device.
        unsafe {
            let _ = self.vk.device_wait_idle();
            for Bytes(buffer, memory) in self.made.take() {
                self.vk.destroy_buffer(buffer, None);
                self.vk.free_memory(memory, None);
            }
            for semaphore in self.semaphores.take() {
                self.vk.destroy_semaphore(semaphore, None);
            }
            self.vk.destroy_command_pool(self.pool, None);
            self.vk.destroy_device(None);
        }
    }
}
