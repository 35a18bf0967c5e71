//! Vertices on their way to the builder.

use crate::device::Gpu;
use crate::memory::{Buffer, Place};
use backend::{Result, Snapshot, Ticket};
use geom::Point;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers that wait to be filled again.
type Spare = Arc<Mutex<Vec<Buffer>>>;

/// Readback buffers, given out and taken back.
pub(crate) struct Snapshots {
    spare: Spare,
    pub(crate) under_way: Option<UnderWay>,
}

/// A copy that the transfer queue is at, or will be.
pub(crate) struct UnderWay {
    pub(crate) ticket: Ticket,
    pub(crate) buffer: Buffer,
    /// The transfer's value.
    pub(crate) done_at: u64,
    /// Which of the two position buffers is being read.
    pub(crate) position: usize,
}

impl Snapshots {
    pub(crate) fn new() -> Self {
        Self {
            spare: Spare::default(),
            under_way: None,
        }
    }

    /// A buffer for that many bytes.
    pub(crate) fn buffer(&self, gpu: &Arc<Gpu>, bytes: u64) -> Result<Buffer> {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        match spare.pop() {
            Some(buffer) if buffer.bytes >= bytes => Ok(buffer),
            _ => Buffer::new(gpu, "vertices for the builder", bytes, Place::Readback),
        }
    }

    /// Wraps a filled buffer so that it comes back when the builder is done with it.
    pub(crate) fn give_out(&self, buffer: Buffer, vertices: usize) -> Snapshot {
        let spare = Arc::clone(&self.spare);
        Box::new(Loan {
            buffer: Some(buffer),
            vertices,
            spare,
        })
    }
}

struct Loan {
    /// Taken out when the loan ends.
    buffer: Option<Buffer>,
    vertices: usize,
    spare: Spare,
}

impl Deref for Loan {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        let buffer = self
            .buffer
            .as_ref()
            .expect("the buffer stays until the loan ends");
        buffer.read(self.vertices)
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        spare.extend(self.buffer.take());
    }
}
