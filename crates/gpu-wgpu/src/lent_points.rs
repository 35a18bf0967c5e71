//! Positions in buffers of the program, which are copied from buffer to buffer.

use crate::buffers::copy_part;
use crate::gpu::OpenGpu;
use backend::Result;
use geom::Point;
use gpu_common::{PointsCopy, without};
use std::ops::Range;
use wgpu::{Buffer, BufferUsages, CommandEncoder};

pub(crate) const POINT: u64 = size_of::<Point>() as u64;

/// The latest positions from buffers of the program.
#[derive(Default)]
pub(crate) struct DevicePoints {
    /// Runs of the scene's positions that come from the program, in order.
    pub(crate) runs: Vec<Range<usize>>,
    /// Runs that are in no key frame yet, with the buffer and the offset at which each begins.
    pub(crate) brought: Vec<(Range<usize>, (Buffer, u64))>,
    /// The key frame that contains all other runs.
    newest: Option<Buffer>,
    /// Copy commands at the start of the next submission.
    pub(crate) commands: Vec<PointsCopy<Buffer>>,
}

impl DevicePoints {
    /// Returns the parts of `runs` that come from the host.
    pub(crate) fn others(&self, runs: &[Range<usize>]) -> Vec<Range<usize>> {
        without(runs, &self.runs)
    }

    /// Schedules copies of all runs to a key frame. Adds those that a kernel can perform to `copies`: from buffers of
    /// at most `largest` bytes that it can bind. A kernel takes half the time of a copy command.
    pub(crate) fn copy_to(
        &mut self,
        key: &Buffer,
        largest: u64,
        copies: &mut Vec<PointsCopy<Buffer>>,
    ) {
        if self.runs.is_empty() {
            return;
        }
        for run in &self.runs {
            // The previous key frame may have used the same buffer.
            let Some(from) = self.place(run).filter(|(buffer, _)| buffer != key) else {
                continue;
            };
            let (buffer, _) = &from;
            let is_bindable =
                buffer.usage().contains(BufferUsages::STORAGE) && buffer.size() <= largest;
            let by = if is_bindable {
                &mut *copies
            } else {
                &mut self.commands
            };
            by.push(PointsCopy {
                from,
                to: (key.clone(), run.start as u64 * POINT),
                bytes: run.len() as u64 * POINT,
            });
        }
        self.brought.clear();
        self.newest = Some(key.clone());
    }

    /// Returns the buffer and offset at which a run begins.
    pub(crate) fn place(&self, run: &Range<usize>) -> Option<(Buffer, u64)> {
        let brought = self.brought.iter().find(|(other, _)| other == run);
        match brought {
            Some((_, place)) => Some(place.clone()),
            None => Some((self.newest.clone()?, run.start as u64 * POINT)),
        }
    }

    /// Encodes the copy commands.
    pub(crate) fn encode(&mut self, gpu: &OpenGpu, encoder: &mut CommandEncoder) -> Result<()> {
        self.commands.drain(..).try_for_each(|copy| {
            let (from, to) = ((&copy.from.0, copy.from.1), (&copy.to.0, copy.to.1));
            copy_part(gpu, encoder, from, to, copy.bytes)
        })
    }
}
