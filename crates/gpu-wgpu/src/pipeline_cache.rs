//! Compiled kernels, kept in a file between runs. Unsafe code is here too.
#![expect(unsafe_code, reason = "wgpu cannot check what a cache holds")]

use gpu_common::cache_file::CacheFile;
use std::path::Path;
use wgpu::{AdapterInfo, Features, PipelineCacheDescriptor};

/// wgpu's cache of pipelines, and the file that it came from.
pub(crate) struct PipelineCache {
    wgpu: wgpu::PipelineCache,
    file: CacheFile,
}

impl PipelineCache {
    /// The cache kept in a folder for this adapter and driver, where the device can keep one.
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
        let desc = PipelineCacheDescriptor {
            label: Some("abvh"),
            data: data.as_deref(),
            fallback: true,
        };
        // SAFETY: the data is what wgpu gave for this adapter, as its digest says; wgpu leaves another driver's aside.
        let wgpu = unsafe { device.create_pipeline_cache(&desc) };
        Some(Self { wgpu, file })
    }

    pub(crate) fn wgpu(&self) -> &wgpu::PipelineCache {
        &self.wgpu
    }

    /// Keeps what was added.
    pub(crate) fn store(&self) {
        let data = self.wgpu.get_data();
        data.iter().for_each(|data| self.file.store(data));
    }
}
