//! Buffers without memory.

use crate::errors::failed_for;
use crate::gpu::Gpu;
use ash::vk;
use backend::Result;

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
