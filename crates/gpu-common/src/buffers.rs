//! Buffers by name.

use crate::{GpuDevice, with_slack};
use backend::{BackendError, Result};
use shaders::BufferName;

/// Returns an error if a need exceeds a limit.
pub fn check_limit(what: impl FnOnce() -> String, need: u64, limit: u64) -> Result<()> {
    if need <= limit {
        return Ok(());
    }
    let what = what();
    Err(BackendError::Limit { what, need, limit })
}

/// A few buffers, looked up by name.
pub(crate) struct BufferTable<D: GpuDevice>(Vec<(BufferName, D::Buffer)>);

impl<D: GpuDevice> BufferTable<D> {
    /// Creates buffers of these sizes.
    pub(crate) fn new(gpu: &D, sizes: impl IntoIterator<Item = (BufferName, u64)>) -> Result<Self> {
        let make = |(name, bytes)| Ok((name, gpu.buffer(name, bytes)?));
        let made = sizes.into_iter().map(make);
        made.collect::<Result<_>>().map(Self)
    }

    /// Creates buffers with these contents.
    pub(crate) fn filled(gpu: &mut D, contents: &[(BufferName, &[u8])]) -> Result<Self> {
        let sizes = contents.iter().map(|&(name, c)| (name, c.len() as u64));
        let made = Self::new(gpu, sizes)?;
        made.fill(gpu, contents)?;
        Ok(made)
    }

    /// Fills some of the buffers from their beginning.
    pub(crate) fn fill(&self, gpu: &mut D, contents: &[(BufferName, &[u8])]) -> Result<()> {
        let buffer = |name| self.get(name).expect("the table has this buffer");
        let all = contents.iter().map(|&(name, c)| (c, buffer(name)));
        gpu.upload(&all.collect::<Vec<_>>())
    }

    /// Returns the buffer of this name, if there is one.
    pub(crate) fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        let found = self.0.iter().find(|(n, _)| *n == name);
        found.map(|(_, buffer)| buffer)
    }

    /// Returns the buffer of this name with at least `bytes`. Replaces a smaller buffer, which no unfinished submission
    /// may use.
    pub(crate) fn fit(&mut self, gpu: &D, name: BufferName, bytes: u64) -> Result<&mut D::Buffer> {
        let mut all = self.0.iter();
        let fits = all.position(|(n, buffer)| *n == name && D::size(buffer).bytes >= bytes);
        if fits.is_none() {
            self.0.retain(|(n, _)| *n != name);
            self.0.push((name, gpu.buffer(name, bytes)?));
        }
        let at = fits.unwrap_or(self.0.len() - 1);
        Ok(&mut self.0[at].1)
    }

    /// Replaces buffers that are smaller than these sizes by larger ones, with slack. Returns the smaller ones, which
    /// recorded or submitted work may still use. On an error, replaces none.
    pub(crate) fn grow(&mut self, gpu: &D, sizes: &[(BufferName, u64)]) -> Result<Vec<D::Buffer>> {
        let mut larger = Vec::new();
        for (at, (name, buffer)) in self.0.iter().enumerate() {
            let size = sizes.iter().find(|(n, _)| n == name);
            if let Some(&(_, bytes)) = size.filter(|(_, bytes)| D::size(buffer).bytes < *bytes) {
                larger.push((at, with_slack(bytes, |bytes| gpu.buffer(*name, bytes))?));
            }
        }
        let replaced = larger.into_iter();
        let replaced = replaced.map(|(at, buffer)| std::mem::replace(&mut self.0[at].1, buffer));
        Ok(replaced.collect())
    }

    pub(crate) fn into_buffers(self) -> impl Iterator<Item = D::Buffer> + use<D> {
        self.0.into_iter().map(|(_, buffer)| buffer)
    }

    /// Returns the bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        self.0.iter().map(|(_, b)| D::size(b).allocated).sum()
    }
}
