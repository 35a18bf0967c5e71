//! Host memory for copies from and to the device, which run concurrently with frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
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

/// Timelines of the work that may use a buffer.
#[derive(Clone, Copy)]
pub(crate) struct Timelines<'a> {
    pub(crate) uploads: &'a Timeline,
    pub(crate) submissions: &'a Timeline,
}

impl Timelines<'_> {
    /// Returns whether the last use of a buffer has finished. Waits for it first if `may_wait` is set.
    pub(crate) fn has_ended(self, last: LastUse, may_wait: bool) -> Result<bool> {
        if may_wait {
            self.submissions.wait(last.ticket)?;
            self.uploads.wait(last.upload_value)?;
        }
        Ok(self.submissions.has_reached(last.ticket)?
            && self.uploads.has_reached(last.upload_value)?)
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

    /// Returns a staging buffer of at least `bytes`. A new one is created with slack.
    pub(crate) fn take(
        &mut self,
        gpu: &Arc<Gpu>,
        timelines: Timelines<'_>,
        bytes: u64,
    ) -> Result<StagingBuffer> {
        let of = |bytes| Buffer::new(gpu, self.what, bytes, BufferUse::Staging);
        let free = self
            .free
            .fit(bytes, |last, may_wait| timelines.has_ended(last, may_wait))?;
        let buffer = match free {
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
