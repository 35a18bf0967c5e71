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

/// Copies on one queue, which start in order and have a timeline of their own.
pub struct Transfer {
    pub(crate) done: Timeline,
    pub(crate) queue: Arc<Queue>,
    /// Value of the copy that started last.
    pub last: u64,
    lanes: Vec<TransferCommands>,
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
            lanes: Vec::new(),
            gpu: Arc::clone(gpu),
        })
    }

    /// Starts to copy ranges of one buffer, each to an offset in another, after an optional moment. Returns the
    /// timeline value at which the copy has finished. Never blocks.
    pub fn start(
        &mut self,
        buffers: [vk::Buffer; 2],
        parts: &[(Range<u64>, u64)],
        after: Option<SemaphoreValue>,
    ) -> Result<u64> {
        let regions = parts.iter().flat_map(|(bytes, at)| pieces(bytes, *at));
        let regions: Vec<_> = regions.collect();
        if regions.is_empty() && after.is_none() {
            return Ok(self.last);
        }
        self.start_recorded(after.as_slice(), |commands| {
            commands.copy(buffers, &regions);
        })
    }

    /// Starts several copies, each after the one before, and all of them after some moments. Returns the timeline value
    /// at which all have finished. Never blocks.
    pub(crate) fn start_in_order(
        &mut self,
        copies: &[([vk::Buffer; 2], Vec<vk::BufferCopy>)],
        after: &[SemaphoreValue],
    ) -> Result<u64> {
        self.start_recorded(after, |commands| {
            for (buffers, regions) in copies {
                commands.barrier(COPIES, COPIES);
                commands.copy(*buffers, regions);
            }
        })
    }

    fn start_recorded(
        &mut self,
        after: &[SemaphoreValue],
        record: impl FnOnce(&Commands),
    ) -> Result<u64> {
        let lane = self.free_lane()?;
        let commands = &mut self.lanes[lane].commands;
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
        (self.last, self.lanes[lane].busy_until) = (value, value);
        Ok(value)
    }

    /// Returns a lane whose last copy has finished, or a new one.
    fn free_lane(&mut self) -> Result<usize> {
        for (i, lane) in self.lanes.iter().enumerate() {
            if self.done.has_reached(lane.busy_until)? {
                return Ok(i);
            }
        }
        self.lanes.push(TransferCommands {
            commands: Commands::new(&self.gpu, self.queue.family)?,
            busy_until: 0,
        });
        Ok(self.lanes.len() - 1)
    }

    /// Blocks until all copies have finished.
    pub fn wait(&self) -> Result<()> {
        self.done.wait(self.last)
    }
}

fn pieces(bytes: &Range<u64>, to_at: u64) -> Vec<vk::BufferCopy> {
    let region = |at| {
        vk::BufferCopy::default()
            .src_offset(at)
            .dst_offset(to_at + (at - bytes.start))
            .size(PIECE.min(bytes.end - at))
    };
    bytes.clone().step_by(PIECE as usize).map(region).collect()
}

impl Drop for Transfer {
    fn drop(&mut self) {
        // An error means that the device is lost; there is nothing to wait for.
        let _ = self.wait();
    }
}

/// Uploads data in pieces through a staging buffer. Blocks until each piece has been copied.
pub(crate) fn load(
    gpu: &Arc<Gpu>,
    transfer: &mut Transfer,
    all: &[(&[u8], &Buffer)],
) -> Result<()> {
    const BYTES: usize = 32 << 20;
    let largest = all.iter().map(|(data, _)| data.len()).max().unwrap_or(0);
    let bytes = largest.min(BYTES) as u64;
    let mut window = Buffer::new(gpu, "a loading window", bytes, BufferUse::Upload)?;
    let most = window.bytes as usize;
    for (data, to) in all {
        for (i, piece) in data.chunks(most).enumerate() {
            window.write(0, piece);
            let part = (0..piece.len() as u64, (i * most) as u64);
            transfer.start([window.vk, to.vk], &[part], None)?;
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
        assert!(pieces(&(0..0), 5).is_empty());
        for bytes in [1, PIECE, PIECE + 1, 10 * PIECE + 7] {
            let all = pieces(&(0..bytes), 5);
            let mut at = 0;
            for piece in &all {
                assert_eq!((piece.src_offset, piece.dst_offset), (at, at + 5));
                assert!(piece.size > 0 && piece.size <= PIECE);
                at += piece.size;
            }
            assert_eq!(at, bytes);
        }
    }
}
