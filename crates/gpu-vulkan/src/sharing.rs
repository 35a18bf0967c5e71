//! Support of a device for memory and semaphores that are shared with other interfaces or with the host.

use crate::allocator::usage;
use crate::instance::VulkanInstance;
use ash::ext::external_memory_host;
use ash::{khr, vk};
use std::ffi::CStr;

pub(crate) const MEMORY_EXTENSION: &CStr = khr::external_memory_fd::NAME;
pub(crate) const SEMAPHORE_EXTENSION: &CStr = khr::external_semaphore_fd::NAME;
pub(crate) const PAGES: vk::ExternalMemoryHandleTypeFlags =
    vk::ExternalMemoryHandleTypeFlags::HOST_ALLOCATION_EXT;

/// Returns the extensions for sharing memory and semaphores that the device offers.
pub(crate) fn extensions(
    instance: &VulkanInstance,
    device: vk::PhysicalDevice,
) -> Vec<&'static CStr> {
    let all = [
        MEMORY_EXTENSION,
        SEMAPHORE_EXTENSION,
        external_memory_host::NAME,
    ];
    instance.offered(device, &all)
}

/// Returns the operations that the device supports on shared memory of a handle type, for buffers with this usage.
pub(crate) fn memory_features(
    instance: &VulkanInstance,
    device: vk::PhysicalDevice,
    usage: vk::BufferUsageFlags,
    kind: vk::ExternalMemoryHandleTypeFlags,
) -> vk::ExternalMemoryFeatureFlags {
    let info = vk::PhysicalDeviceExternalBufferInfo::default();
    let info = info.usage(usage).handle_type(kind);
    let mut found = vk::ExternalBufferProperties::default();
    let instance = &instance.vk;
    // SAFETY: the device belongs to the instance, which is alive.
    unsafe { instance.get_physical_device_external_buffer_properties(device, &info, &mut found) };
    found.external_memory_properties.external_memory_features
}

/// Properties of a device that can import host pages.
pub(crate) struct Import {
    pub(crate) calls: external_memory_host::Device,
    /// Alignment of addresses and sizes, in bytes.
    pub(crate) alignment: u64,
    /// Bit mask of memory types that are cached and need no flushes.
    pub(crate) types: u32,
}

impl Import {
    /// Returns `None` if the device, opened with these extensions, cannot import pages.
    pub(crate) fn of(
        instance: &VulkanInstance,
        physical: vk::PhysicalDevice,
        vk: &ash::Device,
        extensions: &[&CStr],
    ) -> Option<Self> {
        if !extensions.contains(&external_memory_host::NAME) {
            return None;
        }
        let features = memory_features(instance, physical, usage(false), PAGES);
        if !features.contains(vk::ExternalMemoryFeatureFlags::IMPORTABLE) {
            return None;
        }
        let mut bounds = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut bounds);
        instance.read_properties(physical, &mut chain);
        // SAFETY: the device belongs to the instance, which is alive.
        let memory = unsafe { instance.vk.get_physical_device_memory_properties(physical) };
        let wanted = vk::MemoryPropertyFlags::HOST_COHERENT | vk::MemoryPropertyFlags::HOST_CACHED;
        // Device-coherent memory requires a feature that is not enabled.
        let other = vk::MemoryPropertyFlags::DEVICE_COHERENT_AMD;
        let is_fit =
            |flags: vk::MemoryPropertyFlags| flags.contains(wanted) && !flags.intersects(other);
        let types = memory.memory_types_as_slice().iter().enumerate();
        let types = types.filter(|(_, t)| is_fit(t.property_flags));
        Some(Self {
            calls: external_memory_host::Device::new(&instance.vk, vk),
            alignment: bounds.min_imported_host_pointer_alignment,
            types: types.map(|(i, _)| 1 << i).sum(),
        })
    }
}
