//! Positions on their way to the builder.

use crate::memory::Buffer;
use backend::Snapshot;
use geom::Point;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers that wait to be filled again.
#[derive(Clone, Default)]
pub(crate) struct Spare(Arc<Mutex<Vec<Buffer>>>);

impl Spare {
    pub(crate) fn pop(&self) -> Option<Buffer> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }
}

/// A copy that the transfer queue is at, or will be.
pub struct PositionsCopy {
    pub(crate) buffer: Buffer,
    /// The transfer's value.
    pub(crate) done_at: u64,
}

impl PositionsCopy {
    /// What has arrived. The buffer comes back to `spare` when the builder is done with it.
    pub(crate) fn take(self, vertices: usize, spare: &Spare) -> Snapshot {
        Box::new(BorrowedPositions {
            buffer: Some(self.buffer),
            vertices,
            spare: spare.clone(),
        })
    }
}

struct BorrowedPositions {
    /// Taken out when the loan ends.
    buffer: Option<Buffer>,
    vertices: usize,
    spare: Spare,
}

impl Deref for BorrowedPositions {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        let buffer = self.buffer.as_ref();
        let buffer = buffer.expect("the buffer stays until the loan ends");
        buffer.read(self.vertices)
    }
}

impl Drop for BorrowedPositions {
    fn drop(&mut self) {
        let mut spare = self.spare.0.lock().unwrap_or_else(PoisonError::into_inner);
        spare.extend(self.buffer.take());
    }
}
