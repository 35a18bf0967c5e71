//! Copies between host and device that run concurrently with frames.

use crate::commands::{COPIES, Commands, HOST};
use crate::gpu::{Gpu, Queue};
use crate::memory::{Buffer, BufferUse};
use crate::timeline::{QueueBatch, SemaphoreValue, Timeline, submit};
use ash::vk;
use backend::Result;
use std::ops::Range;
use std::sync::Arc;

/// Bytes per region of a copy. One large copy across the bus nearly doubles the time of kernels that read memory
/// meanwhile. Copies in regions of this size do not slow them down.
const PIECE: u64 = 256 << 10;

/// Regions to copy from one buffer to another.
pub struct BufferCopy {
    from: vk::Buffer,
    to: vk::Buffer,
    regions: Vec<vk::BufferCopy>,
}

impl BufferCopy {
    /// Creates a copy without regions.
    pub fn between(from: vk::Buffer, to: vk::Buffer) -> Self {
        let regions = Vec::new();
        Self { from, to, regions }
    }

    /// Adds a range of bytes, which is copied to byte `to_offset`.
    #[must_use]
    pub fn range(mut self, bytes: Range<u64>, to_offset: u64) -> Self {
        let region = |at| {
            vk::BufferCopy::default()
                .src_offset(at)
                .dst_offset(to_offset + (at - bytes.start))
                .size(PIECE.min(bytes.end - at))
        };
        let pieces = bytes.clone().step_by(PIECE as usize);
        self.regions.extend(pieces.map(region));
        self
    }
}

/// Copies on one queue, which start in order and have a timeline of their own.
pub struct Transfer {
    pub(crate) done: Timeline,
    pub(crate) queue: Arc<Queue>,
    /// Value of the copy that started last.
    pub last: u64,
    recorders: Vec<TransferCommands>,
    gpu: Arc<Gpu>,
}

/// A command buffer, and the timeline value at which it can be reused.
struct TransferCommands {
    commands: Commands,
    busy_until: u64,
}

impl Transfer {
    pub(crate) fn new(gpu: &Arc<Gpu>, queue: Arc<Queue>) -> Result<Self> {
        Ok(Self {
            done: Timeline::new(gpu)?,
            queue,
            last: 0,
            recorders: Vec::new(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Starts a copy that waits for the semaphore values `after`. Returns the timeline value at which it has finished.
    /// Never blocks.
    pub fn start(&mut self, copy: &BufferCopy, after: &[SemaphoreValue]) -> Result<u64> {
        if copy.regions.is_empty() && after.is_empty() {
            return Ok(self.last);
        }
        self.record(after, |commands| {
            commands.copy(copy.from, copy.to, &copy.regions);
        })
    }

    /// Starts several copies, one after another, that wait for the semaphore values `after`. Returns the timeline value
    /// at which all have finished. Never blocks.
    pub(crate) fn start_in_order(
        &mut self,
        copies: &[BufferCopy],
        after: &[SemaphoreValue],
    ) -> Result<u64> {
        self.record(after, |commands| {
            for copy in copies {
                commands.barrier(COPIES, COPIES);
                commands.copy(copy.from, copy.to, &copy.regions);
            }
        })
    }

    fn record(&mut self, after: &[SemaphoreValue], record: impl FnOnce(&Commands)) -> Result<u64> {
        let recorder = self.free_recorder()?;
        let commands = &mut self.recorders[recorder].commands;
        commands.reset()?;
        commands.begin()?;
        record(commands);
        commands.barrier(COPIES, HOST);
        commands.end()?;
        let value = self.last + 1;
        let batch = QueueBatch {
            commands: Some(commands.vk()),
            after,
            done: self.done.at(value),
        };
        submit(&self.gpu, &self.queue, &[batch])?;
        (self.last, self.recorders[recorder].busy_until) = (value, value);
        Ok(value)
    }

    /// Returns the index of a recorder whose last copy has finished, or of a new one.
    fn free_recorder(&mut self) -> Result<usize> {
        for (i, recorder) in self.recorders.iter().enumerate() {
            if self.done.has_reached(recorder.busy_until)? {
                return Ok(i);
            }
        }
        self.recorders.push(TransferCommands {
            commands: Commands::new(&self.gpu, self.queue.family)?,
            busy_until: 0,
        });
        Ok(self.recorders.len() - 1)
    }

    /// Blocks until all copies have finished.
    pub fn wait(&self) -> Result<()> {
        self.done.wait(self.last)
    }
}

impl Drop for Transfer {
    fn drop(&mut self) {
        // An error means that the device is lost; there is nothing to wait for.
        let _ = self.wait();
    }
}

/// Uploads data in pieces through a staging buffer. Blocks until each piece has been copied.
pub(crate) fn upload(
    gpu: &Arc<Gpu>,
    transfer: &mut Transfer,
    all: &[(&[u8], &Buffer)],
) -> Result<()> {
    const BYTES: usize = 32 << 20;
    let largest = all.iter().map(|(data, _)| data.len()).max().unwrap_or(0);
    let bytes = largest.min(BYTES) as u64;
    let mut staging = Buffer::new(gpu, "staging memory", bytes, BufferUse::Upload)?;
    let most = staging.bytes as usize;
    for (data, to) in all {
        for (i, piece) in data.chunks(most).enumerate() {
            staging.write(0, piece);
            let copy = BufferCopy::between(staging.vk, to.vk);
            let copy = copy.range(0..piece.len() as u64, (i * most) as u64);
            transfer.start(&copy, &[])?;
            transfer.wait()?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_contiguous_and_bounded() {
        let none = vk::Buffer::null();
        let pieces = |bytes| BufferCopy::between(none, none).range(0..bytes, 5).regions;
        assert!(pieces(0).is_empty());
        for bytes in [1, PIECE, PIECE + 1, 10 * PIECE + 7] {
            let mut at = 0;
            for piece in pieces(bytes) {
                assert_eq!((piece.src_offset, piece.dst_offset), (at, at + 5));
                assert!(piece.size > 0 && piece.size <= PIECE);
                at += piece.size;
            }
            assert_eq!(at, bytes);
        }
    }
}
