//! Positions in buffers of the program, which are copied from buffer to buffer.

use crate::gpu::OpenGpu;
use crate::limits::bindable_bytes;
use backend::Result;
use geom::Point;
use gpu_common::{ExternalPoints, PointsCopy, PointsSource};
use std::ops::Range;
use wgpu::{Buffer, BufferUsages, CommandEncoder, Limits};

pub(crate) const POINT: u64 = size_of::<Point>() as u64;

/// The latest positions from buffers of the program.
#[derive(Default)]
pub(crate) struct BufferPoints {
    /// Sources are pending until a key frame contains them.
    pub(crate) points: ExternalPoints<Buffer>,
    /// The newest key frame. It contains all runs without a pending source.
    newest: Option<Buffer>,
    /// Copy commands at the start of the next submission.
    pub(crate) commands: Vec<PointsCopy<Buffer>>,
}

impl BufferPoints {
    /// Schedules copies of all runs to a key frame. Adds a copy to `copies`, which a kernel performs, if a storage
    /// binding can cover the source. Schedules a copy command otherwise, which takes twice as long.
    pub(crate) fn copy_to(
        &mut self,
        key: &Buffer,
        limits: &Limits,
        copies: &mut Vec<PointsCopy<Buffer>>,
    ) {
        if self.points.runs().is_empty() {
            return;
        }
        for run in self.points.runs() {
            // If this key frame reuses the buffer of the newest one, the positions are already in place.
            let source = self.source(run).filter(|source| source.buffer != *key);
            let Some(PointsSource { buffer, offset, .. }) = source else {
                continue;
            };
            let bytes = run.len() as u64 * POINT;
            let is_bindable = buffer.usage().contains(BufferUsages::STORAGE)
                && offset + bytes <= bindable_bytes(limits, &buffer);
            let list = if is_bindable {
                &mut *copies
            } else {
                &mut self.commands
            };
            list.push(PointsCopy {
                from: (buffer, offset),
                to: (key.clone(), run.start as u64 * POINT),
                bytes,
            });
        }
        self.points.pending.clear();
        self.newest = Some(key.clone());
    }

    /// Returns the buffer that contains a run.
    pub(crate) fn source(&self, run: &Range<usize>) -> Option<PointsSource<Buffer>> {
        let mut pending = self.points.pending.iter();
        if let Some(source) = pending.find(|source| source.run == *run) {
            return Some(source.clone());
        }
        Some(PointsSource {
            buffer: self.newest.clone()?,
            offset: run.start as u64 * POINT,
            run: run.clone(),
        })
    }

    /// Encodes the copy commands.
    pub(crate) fn encode(&mut self, gpu: &OpenGpu, encoder: &mut CommandEncoder) -> Result<()> {
        self.commands.drain(..).try_for_each(|copy| {
            let ((from, from_at), (to, to_at)) = (&copy.from, &copy.to);
            gpu.guard("a copy of positions", copy.bytes, || {
                encoder.copy_buffer_to_buffer(from, *from_at, to, *to_at, copy.bytes);
            })
        })
    }
}
