//! The cache of compiled kernels.

use crate::instance::VulkanInstance;
use ash::vk;
use gpu_common::cache_file::CacheFile;
use std::path::Path;

/// The driver's pipeline cache and its file. The cache is optional, so errors are ignored.
pub struct PipelineCache {
    /// Handle. Null if the driver could not create a cache.
    pub vk: vk::PipelineCache,
    file: Option<CacheFile>,
}

impl PipelineCache {
    /// Loads the cache of this device and driver from a folder. Without a folder the cache is not stored.
    pub(crate) fn open(
        instance: &VulkanInstance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        folder: Option<&Path>,
    ) -> Self {
        // SAFETY: the device belongs to the instance, which is alive.
        let p = unsafe { instance.vk.get_physical_device_properties(physical) };
        let uuid = u128::from_be_bytes(p.pipeline_cache_uuid);
        let name = format!(
            "vulkan-{:x}-{:x}-{:x}-{uuid:032x}",
            p.vendor_id, p.device_id, p.driver_version
        );
        let mut file = folder.map(|folder| CacheFile::new(folder, &name));
        let data = file.as_mut().and_then(CacheFile::load).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the device is alive and `data` outlives the call. The file's name identifies device and driver,
        // and its digest shows that the data is undamaged.
        let vk = unsafe { device.create_pipeline_cache(&info, None) };
        Self {
            vk: vk.unwrap_or_default(),
            file,
        }
    }

    /// Stores new entries and destroys the cache.
    pub(crate) fn close(&self, device: &ash::Device) {
        if self.vk == vk::PipelineCache::null() {
            return;
        }
        if let Some(file) = &self.file {
            // SAFETY: device and cache are alive, and no thread compiles any more.
            let data = unsafe { device.get_pipeline_cache_data(self.vk) };
            data.iter().for_each(|data| file.store(data));
        }
        // SAFETY: the device is alive; a pipeline does not need its cache after its creation.
        unsafe { device.destroy_pipeline_cache(self.vk, None) };
    }
}
