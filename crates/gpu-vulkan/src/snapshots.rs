//! Vertices on their way to the builder.

use crate::device::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::{Moment, Timeline};
use crate::transfer::{Copy, Transfer};
use backend::{Result, Snapshot, Ticket};
use geom::Point;
use std::collections::VecDeque;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers that wait to be filled again.
type Spare = Arc<Mutex<Vec<Buffer>>>;

/// Readback buffers, given out and taken back.
#[derive(Default)]
pub(crate) struct Snapshots {
    spare: Spare,
    asked: Option<Asked>,
    /// In the order of the requests, which is that of the copies.
    under_way: VecDeque<UnderWay>,
}

/// A request in the recording.
struct Asked {
    /// Which of the two position buffers.
    position: usize,
    buffer: Buffer,
}

/// A copy that the transfer queue is at, or will be.
struct UnderWay {
    ticket: Ticket,
    buffer: Buffer,
    /// The transfer's value.
    done_at: u64,
    position: usize,
}

impl Snapshots {
    /// Notes that the recording asks for these positions, of so many bytes.
    ///
    /// # Panics
    /// If it did already.
    pub(crate) fn ask(&mut self, gpu: &Arc<Gpu>, position: usize, bytes: u64) -> Result<()> {
        let asked = self.asked.is_some();
        assert!(!asked, "one request of positions a submission");
        let spare = self.spare.lock();
        let spare = spare.unwrap_or_else(PoisonError::into_inner).pop();
        let what = "vertices for the builder";
        let buffer = Buffer::fitting(gpu, what, bytes, BufferUse::Readback, spare)?;
        self.asked = Some(Asked { position, buffer });
        Ok(())
    }

    /// Which position buffer the next interpolation writes, and the copy (of
    /// `done`) that has to end before it does, if both are being read.
    pub(crate) fn position_to_write(
        &self,
        current: usize,
        done: &Timeline,
    ) -> Result<(usize, Option<u64>)> {
        let mut busy_until = [None; 2];
        for u in &self.under_way {
            if !done.has_reached(u.done_at)? {
                busy_until[u.position] = Some(u.done_at);
            }
        }
        let asked = self.asked.as_ref().map(|a| a.position);
        Ok(soonest(current, asked, busy_until))
    }

    /// Starts the copy asked for, if one was: after `ready`, for `ticket`. Returns its bytes.
    pub(crate) fn start(
        &mut self,
        road: &mut Transfer,
        positions: &[Buffer; 2],
        (ticket, ready): (Ticket, Moment),
        bytes: u64,
    ) -> Result<()> {
        let Some(Asked { position, buffer }) = self.asked.take() else {
            return Ok(());
        };
        let copy = Copy {
            from: &positions[position],
            to: &buffer,
            to_at: 0,
            bytes,
        };
        let done_at = road.start(copy, Some(ready))?;
        self.under_way.push_back(UnderWay {
            ticket,
            buffer,
            done_at,
            position,
        });
        Ok(())
    }

    /// Whether the recording asks for positions.
    pub(crate) fn is_asked(&self) -> bool {
        self.asked.is_some()
    }

    /// The oldest, if it has arrived. It comes back when the builder is done with it.
    pub(crate) fn take(
        &mut self,
        done: &Timeline,
        vertices: usize,
    ) -> Result<Option<(Ticket, Snapshot)>> {
        let Some(oldest) = self.under_way.front() else {
            return Ok(None);
        };
        if !done.has_reached(oldest.done_at)? {
            return Ok(None);
        }
        let spare = Arc::clone(&self.spare);
        let loan = |u: UnderWay| -> (Ticket, Snapshot) {
            let loan = BorrowedPositions {
                buffer: Some(u.buffer),
                vertices,
                spare,
            };
            (u.ticket, Box::new(loan))
        };
        Ok(self.under_way.pop_front().map(loan))
    }

    /// Drops the request in the recording: it is not going to be submitted.
    pub(crate) fn abandon(&mut self) {
        self.asked = None;
    }

    /// Forgets everything: another scene was loaded. No copy may be under way.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// Of two position buffers the one that is free first, and until when it is
/// not; the current one for choice, never one `asked` for in this recording.
fn soonest(
    current: usize,
    asked: Option<usize>,
    busy_until: [Option<u64>; 2],
) -> (usize, Option<u64>) {
    [current, 1 - current]
        .into_iter()
        .filter(|&p| asked != Some(p))
        .map(|p| (p, busy_until[p]))
        .min_by_key(|&(_, busy)| busy)
        .expect("at most one of two is asked for")
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
        buffer
            .expect("the buffer stays until the loan ends")
            .read(self.vertices)
    }
}

impl Drop for BorrowedPositions {
    fn drop(&mut self) {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        spare.extend(self.buffer.take());
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn positions_are_written_where_nobody_reads_or_where_reading_ends_first() {
        assert_eq!(soonest(1, None, [None, None]), (1, None));
        assert_eq!(soonest(1, None, [None, Some(3)]), (0, None));
        assert_eq!(soonest(1, Some(1), [Some(3), None]), (0, Some(3)));
        assert_eq!(soonest(0, None, [Some(5), Some(4)]), (1, Some(4)));
        assert_eq!(soonest(0, Some(1), [Some(5), None]), (0, Some(5)));
    }
}
