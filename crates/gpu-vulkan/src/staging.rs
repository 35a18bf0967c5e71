//! Host memory for copies from and to the device, which run concurrently with frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::Transfer;
use crate::vulkan_device::VulkanDevice;
use backend::Result;
use geom::{KeyFrame, Point, SharedMemory, copy_in_parallel};
use gpu_common::{LastUse, Pool, with_slack};
use std::collections::VecDeque;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Writes parts one after another, using several threads. Returns `false` if they do not fit.
pub(crate) fn fill(staging: &mut Buffer, parts: &[&[u32]]) -> bool {
    let mut to = staging.view_mut();
    if parts.iter().map(|part| part.len()).sum::<usize>() > to.len() {
        return false;
    }
    for part in parts {
        let (of_part, rest) = to.split_at_mut(part.len());
        copy_in_parallel(of_part, part);
        to = rest;
    }
    true
}

/// Progress of uploads and submissions.
pub(crate) type Done<'a> = (&'a Transfer, &'a Timeline);

/// See [`gpu_common::GpuDevice::has_ended`].
pub(crate) fn has_ended(
    (uploads, submissions): Done<'_>,
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
pub(crate) struct Staging {
    what: &'static str,
    pub(crate) free: Pool<VulkanDevice>,
}

impl Staging {
    pub(crate) fn new(what: &'static str) -> Self {
        let free = Pool::default();
        Self { what, free }
    }

    /// Returns a staging buffer of at least `bytes`. A new one is created with slack.
    pub(crate) fn take(&mut self, gpu: &Arc<Gpu>, done: Done<'_>, bytes: u64) -> Result<Buffer> {
        let of = |bytes| Buffer::new(gpu, self.what, bytes, BufferUse::Staging);
        let made = || with_slack(bytes, of);
        let has_ended = |last, may_wait| has_ended(done, last, may_wait);
        let (buffer, _) = self.free.fit(bytes, has_ended, made)?;
        Ok(buffer)
    }

    /// Starts the copy of the first `bytes` bytes. Returns the copy's timeline value.
    pub(crate) fn send(
        &mut self,
        road: &mut Transfer,
        (from, bytes): (Buffer, u64),
        to: &Buffer,
    ) -> Result<u64> {
        let arrival = road.start([&from, to], &[(0..bytes, 0)], None)?;
        self.free.put(from, LastUse { arrival, ticket: 0 });
        Ok(arrival)
    }
}

/// Positions or other bytes that the readback queue copies to the host.
pub struct HostCopy {
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
fn bytes_of(runs: &[Range<usize>]) -> Vec<(Range<u64>, u64)> {
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

impl VulkanDevice {
    /// Starts the upload of runs of a key frame from the host.
    pub(crate) fn send_host_key(
        &mut self,
        key: &KeyFrame,
        runs: &[Range<usize>],
        to: &Buffer,
    ) -> Result<u64> {
        if let Some(memory) = key.shared::<HostPoints>() {
            let from = [&memory.buffer, to];
            let value = self.upload.start(from, &bytes_of(runs), None)?;
            self.keys_read.note(&self.upload.done, (value, key))?;
            return Ok(value);
        }
        let (done, bytes) = ((&self.upload, &self.done), size_of_val(&key[..]) as u64);
        let staging = &mut self.key_staging;
        let mut from = staging.take(&self.gpu, done, bytes)?;
        fill(&mut from, &[bytemuck::cast_slice(key)]);
        staging.send(&mut self.upload, (from, bytes), to)
    }
}
