//! Resources lent by the device's owner: positions, rays, memory for hits, and timeline semaphores.

use crate::memory::Buffer;
use crate::timeline::{SemaphoreValue, Timeline};
use crate::transfer::Transfer;
use ash::vk;
use backend::Result;
use geom::Point;
use gpu_common::{LastUse, LentBuffers, Pool, without};
use std::ops::Range;
use std::sync::Arc;

pub(crate) const POINT: u64 = size_of::<Point>() as u64;

/// The resources that were lent last.
#[derive(Default)]
pub(crate) struct LentResources {
    pub(crate) points: LentPoints,
    /// Rays of the next query.
    pub(crate) buffers: LentBuffers<Buffer>,
    /// Moments that must be reached before lent memory is read or written.
    pub(crate) waits: Vec<SemaphoreValue>,
    /// Signals that are not known to have been reached.
    pub(crate) signals: Vec<Signal>,
}

/// The latest positions from external memory.
#[derive(Default)]
pub(crate) struct LentPoints {
    /// Buffer for all positions of the scene.
    pub(crate) all: Option<Buffer>,
    /// Runs of the scene's positions that come from external memory, in order.
    pub(crate) runs: Vec<Range<usize>>,
    /// Copies to `all` that have not started: source buffer, offset in bytes, and run.
    pub(crate) pending: Vec<(Buffer, u64, Range<usize>)>,
}

/// A timeline value to signal for the program. Until then, work here may wait for lower values of the same timeline.
pub(crate) struct Signal {
    pub(crate) timeline: Arc<Timeline>,
    pub(crate) value: u64,
    /// Whether the signal was submitted.
    pub(crate) is_submitted: bool,
}

impl LentPoints {
    pub(crate) fn release(&mut self, run: &Range<usize>) {
        self.pending.retain(|(.., other)| other != run);
        self.runs = without(&self.runs, std::slice::from_ref(run));
    }
}

impl LentResources {
    /// Returns the parts of `runs` that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.points.runs)
    }

    /// Starts to copy new external positions to `all`, and all external positions to a key frame. Returns the upload's
    /// value, if there is anything to copy.
    pub(crate) fn copy_points(
        &mut self,
        upload: &mut Transfer,
        outgrown: &mut Pool<Buffer>,
        key: Option<&Buffer>,
    ) -> Result<Option<u64>> {
        let LentPoints { all, runs, pending } = &self.points;
        let Some(all) = all.as_ref().filter(|_| !runs.is_empty()) else {
            return Ok(None);
        };
        let brought = pending.iter().map(|(from, offset, run)| {
            let region = region(*offset, run.start as u64 * POINT, run);
            ([from.vk, all.vk], vec![region])
        });
        let place = |run: &Range<usize>| {
            let at = run.start as u64 * POINT;
            region(at, at, run)
        };
        let kept = key.map(|key| ([all.vk, key.vk], runs.iter().map(place).collect()));
        let copies: Vec<_> = brought.chain(kept).collect();
        if copies.is_empty() {
            return Ok(None);
        }
        let arrival = upload.start_in_order(&copies, &self.waits)?;
        for (from, ..) in self.points.pending.drain(..) {
            let (size, last) = (from.size(), LastUse { arrival, ticket: 0 });
            outgrown.put(from, size, last);
        }
        Ok(Some(arrival))
    }

    /// Waits until the submitted signals are reached.
    pub(crate) fn wait(&self) -> Result<()> {
        let mut submitted = self.signals.iter().filter(|signal| signal.is_submitted);
        submitted.try_for_each(|signal| signal.timeline.wait(signal.value))
    }
}

/// Returns the copy of a run between two byte offsets.
fn region(from: u64, to: u64, run: &Range<usize>) -> vk::BufferCopy {
    vk::BufferCopy::default()
        .src_offset(from)
        .dst_offset(to)
        .size(run.len() as u64 * POINT)
}
