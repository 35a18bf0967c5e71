//! Host pages that the device accesses directly, imported by `VK_EXT_external_memory_host`.
//!
//! A driver that allocates host memory prepares it page by page, and submissions block meanwhile: 17 ms for 64 MiB.
//! Importing existing pages takes 4 ms, or 2 ms for large pages (NVIDIA 580, H100).

use crate::allocator::usage;
use crate::gpu::Gpu;
use crate::sharing::{Import, PAGES};
use ash::vk;
use memmap2::MmapMut;
use std::sync::Arc;

/// Minimum bytes of a buffer with pages of its own. Smaller buffers share an allocation.
const LEAST: u64 = 1 << 20;

/// Pages and the device memory imported from them.
pub(crate) struct HostMemory {
    memory: vk::DeviceMemory,
    pub(crate) pages: MmapMut,
    gpu: Arc<Gpu>,
}

impl HostMemory {
    /// Creates a buffer over pages of its own. Returns `None` if the buffer is small or the pages cannot be
    /// imported. The caller then allocates memory.
    pub(crate) fn buffer(gpu: &Arc<Gpu>, what: &str, bytes: u64) -> Option<(vk::Buffer, Self)> {
        let import = gpu.import.as_ref().filter(|_| bytes >= LEAST)?;
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(PAGES);
        let info = vk::BufferCreateInfo::default()
            .size(bytes)
            .usage(usage(false))
            .push_next(&mut external);
        let buffer = gpu.create_buffer(what, info).ok()?;
        // SAFETY: the buffer was just created from this device.
        let needs = unsafe { gpu.vk.get_buffer_memory_requirements(buffer) };
        let made = Self::new(gpu, import, needs).filter(|made| {
            // SAFETY: the memory meets the buffer's requirements and is bound once.
            unsafe { gpu.vk.bind_buffer_memory(buffer, made.memory, 0) }.is_ok()
        });
        if made.is_none() {
            // SAFETY: the buffer is not in use.
            unsafe { gpu.vk.destroy_buffer(buffer, None) };
        }
        made.map(|made| (buffer, made))
    }

    fn new(gpu: &Arc<Gpu>, import: &Import, needs: vk::MemoryRequirements) -> Option<Self> {
        let bytes = needs.size.next_multiple_of(import.alignment);
        let mut pages = MmapMut::map_anon(usize::try_from(bytes).ok()?).ok()?;
        if !(pages.as_ptr().addr() as u64).is_multiple_of(import.alignment) {
            return None;
        }
        make_present(&pages);
        let (at, get) = (pages.as_mut_ptr().cast(), import.calls.fp());
        let mut found = vk::MemoryHostPointerPropertiesEXT::default();
        // SAFETY: the pages are the process's own and aligned; the extension is enabled.
        let result = unsafe {
            (get.get_memory_host_pointer_properties_ext)(gpu.vk.handle(), PAGES, at, &mut found)
        };
        let types = found.memory_type_bits & needs.memory_type_bits & import.types;
        if result != vk::Result::SUCCESS || types == 0 {
            return None;
        }
        let mut from = vk::ImportMemoryHostPointerInfoEXT::default()
            .handle_type(PAGES)
            .host_pointer(at);
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(bytes)
            .memory_type_index(types.trailing_zeros())
            .push_next(&mut from);
        let _lock = gpu.memory.lock_driver();
        // SAFETY: the pages are aligned, have the size stated, and are unmapped only after the memory is freed.
        let memory = unsafe { gpu.vk.allocate_memory(&info, None) }.ok()?;
        let gpu = Arc::clone(gpu);
        Some(Self { memory, pages, gpu })
    }
}

impl Drop for HostMemory {
    fn drop(&mut self) {
        let _lock = self.gpu.memory.lock_driver();
        // SAFETY: the buffer's owner has waited for the submissions that use it.
        unsafe { self.gpu.vk.free_memory(self.memory, None) };
    }
}

/// Populates pages before the driver reads them, with large pages if possible. A failure only costs time.
fn make_present(pages: &MmapMut) {
    #[cfg(target_os = "linux")]
    for advice in [memmap2::Advice::HugePage, memmap2::Advice::PopulateWrite] {
        let _ = pages.advise(advice);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = pages;
}
