//! Buffers by the names that kernels have for them.

use crate::{BufferPurpose, GpuDevice};
use backend::Result;
use shaders::BufferName;

/// A few buffers, each found by its name.
pub struct BufferTable<D: GpuDevice>(Vec<(BufferName, D::Buffer)>);

impl<D: GpuDevice> BufferTable<D> {
    /// Buffers of these sizes.
    ///
    /// # Errors
    /// Those of [`GpuDevice::buffer`].
    pub fn new(gpu: &D, sizes: impl IntoIterator<Item = (BufferName, u64)>) -> Result<Self> {
        let make = |(name, bytes): (BufferName, u64)| {
            let buffer = gpu.buffer(name.what(), bytes, BufferPurpose::Storage)?;
            Ok((name, buffer))
        };
        let made = sizes.into_iter().map(make);
        made.collect::<Result<_>>().map(Self)
    }

    /// The buffer of that name, where there is one.
    pub fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        let found = self.0.iter().find(|(n, _)| *n == name);
        found.map(|(_, buffer)| buffer)
    }

    /// Puts a larger buffer, with some to spare, in the place of one that is too small. Trees of one scene differ little in
    /// size.
    pub(crate) fn grow(&mut self, gpu: &mut D, name: BufferName, bytes: u64) -> Result<()> {
        let mut found = self.0.iter_mut().filter(|(n, _)| *n == name);
        let Some((_, buffer)) = found.next().filter(|(_, b)| D::size(b) < bytes) else {
            return Ok(());
        };
        let most = gpu.max_buffer_bytes().max(bytes);
        let larger = most.min(bytes + bytes / 32);
        let larger = gpu.buffer(name.what(), larger, BufferPurpose::Storage)?;
        gpu.discard(std::mem::replace(buffer, larger));
        Ok(())
    }

    /// Bytes of device memory.
    pub fn held(&self) -> u64 {
        self.0.iter().map(|(_, b)| D::held(b)).sum()
    }
}
