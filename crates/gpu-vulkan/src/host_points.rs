//! Positions that the device reads or writes where they lie in memory of the host.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::staging::fill;
use crate::timeline::Timeline;
use crate::vulkan_device::VulkanDevice;
use backend::Result;
use geom::{KeyFrame, Point, SharedMemory};
use std::collections::VecDeque;
use std::ops::{Deref, DerefMut, Range};
use std::sync::Arc;

/// Positions, or other bytes, that the transfer queue copies, or will.
pub struct HostCopy {
    pub(crate) buffer: Buffer,
    /// The transfer's value.
    pub(crate) done_at: u64,
}

/// Positions in memory of the host that the device copies to or from.
pub(crate) struct HostPoints {
    pub(crate) buffer: Buffer,
    pub(crate) count: usize,
}

impl HostPoints {
    /// Room for so many, which the device copies from.
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

/// Where runs of positions lie, to be copied to the same place.
fn bytes_of(runs: &[Range<usize>]) -> Vec<(Range<u64>, u64)> {
    let place = |v: usize| (v * size_of::<Point>()) as u64;
    let bytes = |run: &Range<usize>| (place(run.start)..place(run.end), place(run.start));
    runs.iter().map(bytes).collect()
}

/// Key frames that the device copies from where they lie: they stay until it has.
#[derive(Default)]
pub(crate) struct KeysRead(VecDeque<(u64, KeyFrame)>);

impl KeysRead {
    /// Keeps a key frame until the copy of that value is done; lets go of others.
    pub(crate) fn note(&mut self, done: &Timeline, (value, key): (u64, &KeyFrame)) -> Result<()> {
        while let Some((value, _)) = self.0.front() {
            if !done.has_reached(*value)? {
                break;
            }
            self.0.pop_front();
        }
        self.0.push_back((value, KeyFrame::clone(key)));
        Ok(())
    }
}

impl VulkanDevice {
    /// Begins to send runs of a key frame, which are not lent.
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
        let mut from = staging.take(&self.gpu, done, [bytes; 2])?;
        fill(&mut from, &[bytemuck::cast_slice(key)]);
        staging.send(&mut self.upload, (from, bytes), to)
    }
}
