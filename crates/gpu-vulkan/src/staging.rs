//! Memory of the host that things are sent from, beside the frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::Transfer;
use crate::vulkan_device::VulkanDevice;
use backend::Result;
use gpu_common::{LastUse, Pool};
use rayon::prelude::*;
use std::sync::Arc;

/// Words that one task copies.
const RUN: usize = 1 << 17;

/// Writes part by part, by all threads; says whether there is room.
pub(crate) fn fill(staging: &mut Buffer, parts: &[&[u32]]) -> bool {
    let mut to = staging.view_mut();
    if parts.iter().map(|part| part.len()).sum::<usize>() > to.len() {
        return false;
    }
    for part in parts {
        let (of_part, rest) = to.split_at_mut(part.len());
        let runs = of_part.par_chunks_mut(RUN).zip(part.par_chunks(RUN));
        runs.for_each(|(to, from)| to.copy_from_slice(from));
        to = rest;
    }
    true
}

/// What tells how far uploads and submissions are.
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

/// Memory for things of one kind.
pub(crate) struct Staging {
    what: &'static str,
    pub(crate) free: Pool<VulkanDevice>,
}

impl Staging {
    pub(crate) fn new(what: &'static str) -> Self {
        let free = Pool::default();
        Self { what, free }
    }

    /// Memory for so many bytes, with room for some more if it is made.
    pub(crate) fn take(
        &mut self,
        gpu: &Arc<Gpu>,
        done: Done<'_>,
        [bytes, room]: [u64; 2],
    ) -> Result<Buffer> {
        let made = || Buffer::new(gpu, self.what, room, BufferUse::Staging);
        let has_ended = |last, may_wait| has_ended(done, last, may_wait);
        let (buffer, _) = self.free.fit(bytes, has_ended, made)?;
        Ok(buffer)
    }

    /// Begins to send its first bytes. Gives the value of the copy.
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
