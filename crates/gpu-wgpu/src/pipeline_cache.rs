//! The cache of compiled kernels.
#![expect(unsafe_code, reason = "wgpu does not validate the data of a cache")]

use gpu_common::cache_file::CacheFile;
use std::path::Path;
use wgpu::{AdapterInfo, Features};

/// wgpu's pipeline cache and its file.
pub(crate) struct AdapterPipelineCache {
    wgpu: wgpu::PipelineCache,
    file: CacheFile,
}

impl AdapterPipelineCache {
    /// Loads the cache of this adapter and driver from a folder. Returns `None` without a folder, or if the device has
    /// no pipeline cache.
    pub(crate) fn open(
        device: &wgpu::Device,
        info: &AdapterInfo,
        folder: Option<&Path>,
    ) -> Option<Self> {
        if !device.features().contains(Features::PIPELINE_CACHE) {
            return None;
        }
        let mut file = CacheFile::new(folder?, &wgpu::util::pipeline_cache_key(info)?);
        let data = file.load();
        let desc = wgpu::PipelineCacheDescriptor {
            label: Some("abvh"),
            data: data.as_deref(),
            fallback: true,
        };
        // SAFETY: the file's digest shows that wgpu wrote the data for this adapter; wgpu ignores data of another
        // driver.
        let wgpu = unsafe { device.create_pipeline_cache(&desc) };
        Some(Self { wgpu, file })
    }

    pub(crate) fn wgpu(&self) -> &wgpu::PipelineCache {
        &self.wgpu
    }

    /// Stores new entries.
    pub(crate) fn store(&self) {
        let data = self.wgpu.get_data();
        data.iter().for_each(|data| self.file.store(data));
    }
}
