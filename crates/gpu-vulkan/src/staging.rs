//! Host memory for copies from and to the device, which run concurrently with frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::transfer::{BufferCopy, Transfer};
use backend::Result;
use geom::{Point, SharedMemory, copy_in_parallel};
use gpu_common::{LastUse, Pool, Staging, with_slack};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A buffer in host memory from which data is uploaded.
pub struct StagingBuffer {
    buffer: Buffer,
    /// Bytes that were written.
    filled: u64,
}

impl Staging for StagingBuffer {
    fn fill(&mut self, parts: &[&[u32]]) -> bool {
        let mut to = self.buffer.view_mut();
        let words = parts.iter().map(|part| part.len()).sum::<usize>();
        if words > to.len() {
            return false;
        }
        for part in parts {
            let (of_part, rest) = to.split_at_mut(part.len());
            copy_in_parallel(of_part, part);
            to = rest;
        }
        self.filled = (words * size_of::<u32>()) as u64;
        true
    }
}

/// Staging buffers for one kind of data.
pub(crate) struct StagingPool {
    what: &'static str,
    pub(crate) free: Pool<Buffer>,
}

impl StagingPool {
    pub(crate) fn new(what: &'static str) -> Self {
        let free = Pool::default();
        Self { what, free }
    }

    /// Returns a staging buffer of at least `bytes`. A new one is created with slack. See [`Pool::fit`] for `has_ended`.
    pub(crate) fn take(
        &mut self,
        gpu: &Arc<Gpu>,
        bytes: u64,
        has_ended: impl Fn(LastUse, bool) -> Result<bool>,
    ) -> Result<StagingBuffer> {
        let of = |bytes| Buffer::new(gpu, self.what, bytes, BufferUse::Staging);
        let buffer = match self.free.fit(bytes, has_ended)? {
            Some(buffer) => buffer,
            None => with_slack(bytes, of)?,
        };
        Ok(StagingBuffer { buffer, filled: 0 })
    }

    /// Starts the copy of everything that was written. Returns the copy's timeline value.
    pub(crate) fn send(
        &mut self,
        transfer: &mut Transfer,
        from: StagingBuffer,
        to: &Buffer,
    ) -> Result<u64> {
        let StagingBuffer { buffer, filled } = from;
        let copy = BufferCopy::between(buffer.vk, to.vk).range(0..filled, 0);
        let upload_value = transfer.start(&copy, &[])?;
        let size = buffer.size();
        self.free
            .put(buffer, size, LastUse::by_upload(upload_value));
        Ok(upload_value)
    }
}

/// Positions in host memory that the device copies from or to.
pub(crate) struct HostPoints {
    pub(crate) buffer: Buffer,
    pub(crate) count: usize,
}

impl HostPoints {
    /// Allocates memory for `count` positions, which the device copies from.
    pub(crate) fn new(gpu: &Arc<Gpu>, count: usize) -> Result<Self> {
        let bytes = (count * size_of::<Point>()) as u64;
        let buffer = Buffer::new(gpu, "key frames", bytes, BufferUse::Staging)?;
        Ok(Self { buffer, count })
    }
}

impl Deref for HostPoints {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        self.buffer.read(self.count)
    }
}

impl DerefMut for HostPoints {
    fn deref_mut(&mut self) -> &mut [Point] {
        &mut self.buffer.view_mut()[..self.count]
    }
}

impl SharedMemory for HostPoints {}
