//! Host memory for copies from and to the device, which run concurrently with frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::Transfer;
use backend::Result;
use geom::{KeyFrame, Point, SharedMemory, copy_in_parallel};
use gpu_common::{LastUse, Pool, Staging, with_slack};
use std::collections::VecDeque;
use std::ops::{Deref, DerefMut, Range};
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

/// Progress of uploads and submissions.
pub(crate) type QueueProgress<'a> = (&'a Transfer, &'a Timeline);

/// Returns whether the last use of a buffer has finished. Waits for it first if `may_wait` is set.
pub(crate) fn has_ended(
    (uploads, submissions): QueueProgress<'_>,
    last: LastUse,
    may_wait: bool,
) -> Result<bool> {
    if may_wait {
        submissions.wait(last.ticket)?;
        uploads.done.wait(last.arrival)?;
    }
    Ok(submissions.has_reached(last.ticket)? && uploads.done.has_reached(last.arrival)?)
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
        done: QueueProgress<'_>,
        bytes: u64,
    ) -> Result<StagingBuffer> {
        let has_ended = |last, may_wait| has_ended(done, last, may_wait);
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
        let arrival = transfer.start([buffer.vk, to.vk], &[(0..filled, 0)], None)?;
        let (size, last) = (buffer.size(), LastUse { arrival, ticket: 0 });
        self.free.put(buffer, size, last);
        Ok(arrival)
    }
}

/// Positions or other bytes that the readback queue copies to the host.
pub(crate) struct ReadbackCopy {
    pub(crate) buffer: Buffer,
    /// Timeline value of the copy.
    pub(crate) done_at: u64,
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

/// Returns the byte ranges of runs of positions, each with its destination offset, which is the same.
pub(crate) fn bytes_of(runs: &[Range<usize>]) -> Vec<(Range<u64>, u64)> {
    let place = |v: usize| (v * size_of::<Point>()) as u64;
    let bytes = |run: &Range<usize>| (place(run.start)..place(run.end), place(run.start));
    runs.iter().map(bytes).collect()
}

/// Key frames that the device copies from directly. They are kept until the copy has finished.
#[derive(Default)]
pub(crate) struct KeysRead(VecDeque<(u64, KeyFrame)>);

impl KeysRead {
    /// Keeps a key frame until the copy with this value has finished. Drops those whose copies have finished.
    pub(crate) fn note(&mut self, done: &Timeline, (value, key): (u64, &KeyFrame)) -> Result<()> {
        self.0.push_back((value, KeyFrame::clone(key)));
        while let Some((value, _)) = self.0.front() {
            if !done.has_reached(*value)? {
                break;
            }
            self.0.pop_front();
        }
        Ok(())
    }
}
