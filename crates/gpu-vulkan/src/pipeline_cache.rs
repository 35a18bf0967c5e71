//! Compiled kernels, kept in a file between runs.

use crate::instance::Host;
use ash::vk;
use gpu_common::cache_file::CacheFile;
use std::path::Path;

/// The driver's cache of pipelines, and the file that it came from. It is of use and never needed: what goes wrong with it
/// goes unsaid.
pub struct PipelineCache {
    /// Null if the driver could make none.
    vk: vk::PipelineCache,
    file: Option<CacheFile>,
}

impl PipelineCache {
    /// The cache kept in a folder for this device and driver; without a folder, one that is not kept.
    pub(crate) fn open(
        host: &Host,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        folder: Option<&Path>,
    ) -> Self {
        // SAFETY: the device belongs to the instance, which is alive.
        let p = unsafe { host.instance.get_physical_device_properties(physical) };
        let uuid = u128::from_be_bytes(p.pipeline_cache_uuid);
        let name = format!(
            "vulkan-{:x}-{:x}-{:x}-{uuid:032x}",
            p.vendor_id, p.device_id, p.driver_version
        );
        let mut file = folder.map(|folder| CacheFile::new(folder, &name));
        let data = file.as_mut().and_then(CacheFile::load).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the device is alive and `data` outlives the call; it is what this driver gave, as its digest says.
        let vk = unsafe { device.create_pipeline_cache(&info, None) };
        Self {
            vk: vk.unwrap_or_default(),
            file,
        }
    }

    /// Its handle.
    #[must_use]
    pub fn vk(&self) -> vk::PipelineCache {
        self.vk
    }

    /// Keeps what was added, and ends it.
    pub(crate) fn close(&self, device: &ash::Device) {
        if self.vk == vk::PipelineCache::null() {
            return;
        }
        if let Some(file) = &self.file {
            // SAFETY: device and cache are alive, and nobody compiles any more.
            let data = unsafe { device.get_pipeline_cache_data(self.vk) };
            data.iter().for_each(|data| file.store(data));
        }
        // SAFETY: the device is alive; pipelines do not need their cache once made.
        unsafe { device.destroy_pipeline_cache(self.vk, None) };
    }
}
