//! Vertices on their way to the builder.

use crate::buffers::{Mapping, copy, readback, unmap, unreadable};
use crate::device::Gpu;
use backend::{Result, Snapshot, Ticket};
use geom::Point;
use std::collections::VecDeque;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::{Buffer, BufferView, CommandEncoder};

/// Buffers that wait to be filled again.
type Spare = Arc<Mutex<Vec<Buffer>>>;

/// Readback buffers, given out and taken back.
#[derive(Default)]
pub(crate) struct Snapshots {
    spare: Spare,
    /// Asked for in the recording: which of the two position buffers.
    asked: Option<usize>,
    under_way: VecDeque<UnderWay>,
}

/// A copy that the queue is at.
struct UnderWay {
    ticket: Ticket,
    buffer: Buffer,
    mapping: Mapping,
    /// Which of the two position buffers is being read.
    position: usize,
}

impl Snapshots {
    /// Notes that the recording is to end with a copy of these positions.
    pub(crate) fn ask(&mut self, position: usize) {
        assert!(
            self.asked.is_none(),
            "one request of positions a submission"
        );
        self.asked = Some(position);
    }

    /// Which position buffer the next interpolation writes: one that is not being read, if there is one.
    pub(crate) fn free_position(&self, current: usize) -> usize {
        let under_way = |p: usize| {
            let waits = |u: &UnderWay| u.position == p && !u.mapping.has_arrived();
            self.under_way.iter().any(waits)
        };
        let other = 1 - current;
        // One asked for in this recording is copied at its end, so it must not be written before.
        match self.asked {
            Some(asked) if asked == current => other,
            None if under_way(current) && !under_way(other) => other,
            _ => current,
        }
    }

    /// Records the copy asked for, if one was.
    pub(crate) fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        positions: &[Buffer; 2],
        bytes: u64,
    ) -> Result<Option<Begun>> {
        let Some(position) = self.asked.take() else {
            return Ok(None);
        };
        let spare = self
            .spare
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .pop();
        let buffer = match spare.filter(|b| b.size() >= bytes) {
            Some(buffer) => buffer,
            None => readback(gpu, "vertices for the builder", bytes)?,
        };
        copy(gpu, encoder, [&positions[position], &buffer], bytes)?;
        Ok(Some(Begun { buffer, position }))
    }

    /// Follows a copy that was submitted.
    pub(crate) fn follow(&mut self, gpu: &Gpu, begun: Begun, ticket: Ticket) -> Result<()> {
        let Begun { buffer, position } = begun;
        let mapping = Mapping::ask(gpu, &buffer)?;
        self.under_way.push_back(UnderWay {
            ticket,
            buffer,
            mapping,
            position,
        });
        Ok(())
    }

    /// The oldest that has arrived.
    pub(crate) fn take(
        &mut self,
        gpu: &Gpu,
        vertices: usize,
    ) -> Result<Option<(Ticket, Snapshot)>> {
        let arrived = match self.under_way.front() {
            Some(oldest) => oldest.mapping.poll(gpu)?,
            None => false,
        };
        let oldest = if arrived {
            self.under_way.pop_front()
        } else {
            None
        };
        let Some(UnderWay { ticket, buffer, .. }) = oldest else {
            return Ok(None);
        };
        let view = buffer.get_mapped_range(..).map_err(unreadable)?;
        let spare = Arc::clone(&self.spare);
        let loan = BorrowedPositions {
            view: Some(view),
            device: gpu.device.clone(),
            buffer,
            vertices,
            spare,
        };
        Ok(Some((ticket, Box::new(loan))))
    }

    /// Forgets what is under way: another scene was loaded.
    pub(crate) fn forget(&mut self) {
        self.asked = None;
        self.under_way.clear();
        self.spare
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clear();
    }
}

/// A copy that was recorded but not submitted yet.
pub(crate) struct Begun {
    buffer: Buffer,
    position: usize,
}

/// The mapped buffer itself, without a copy: wgpu's view may be sent to and read by any thread.
struct BorrowedPositions {
    /// Taken out when the loan ends.
    view: Option<BufferView>,
    device: wgpu::Device,
    buffer: Buffer,
    vertices: usize,
    spare: Spare,
}

impl Deref for BorrowedPositions {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        let view = self
            .view
            .as_ref()
            .expect("the view stays until the loan ends");
        bytemuck::cast_slice(&view[..self.vertices * size_of::<Point>()])
    }
}

impl Drop for BorrowedPositions {
    fn drop(&mut self) {
        // A buffer is unmapped only when no view looks at it any more.
        drop(self.view.take());
        if unmap(&self.device, &self.buffer) {
            let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
            spare.push(self.buffer.clone());
        }
    }
}
