//! Buffers that wait until nothing uses them any more, to be used again or dropped; and what fills them beside the frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::Transfer;
use backend::{FRAMES_IN_FLIGHT, Result};
use gpu_common::Sent;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// What was recorded or submitted when a buffer was given up: a ticket, and an upload's value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LastUse {
    pub(crate) filled_at: u64,
    pub(crate) ticket: u64,
}

/// What tells how far uploads and submissions are.
type Done<'a> = (&'a Transfer, &'a Timeline);

impl LastUse {
    fn has_passed(self, (uploads, submissions): Done<'_>) -> Result<bool> {
        Ok(submissions.has_reached(self.ticket)? && uploads.done.has_reached(self.filled_at)?)
    }

    fn wait(self, (uploads, submissions): Done<'_>) -> Result<()> {
        submissions.wait(self.ticket)?;
        uploads.done.wait(self.filled_at)
    }
}

/// Buffers with their last use.
#[derive(Default)]
pub(crate) struct Pool(Vec<(LastUse, Buffer)>);

impl Pool {
    pub(crate) fn put(&mut self, buffer: Buffer, last: LastUse) {
        self.0.push((last, buffer));
    }

    /// A buffer that nothing uses, of whatever size; waits for one only if there are `most`.
    pub(crate) fn take(&mut self, done: Done<'_>, most: usize) -> Result<Option<Buffer>> {
        for i in 0..self.0.len() {
            if self.0[i].0.has_passed(done)? {
                return Ok(Some(self.0.remove(i).1));
            }
        }
        let all = self.0.iter().enumerate();
        let first = all.min_by_key(|(_, (last, _))| *last);
        let Some((i, &(last, _))) = first.filter(|_| self.0.len() >= most) else {
            return Ok(None);
        };
        last.wait(done)?;
        Ok(Some(self.0.remove(i).1))
    }

    /// Drops what nothing uses.
    pub(crate) fn prune(&mut self, done: Done<'_>) -> Result<()> {
        let mut kept = Vec::new();
        for (last, buffer) in self.0.drain(..) {
            if !last.has_passed(done)? {
                kept.push((last, buffer));
            }
        }
        self.0 = kept;
        Ok(())
    }

    /// Bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        self.0.iter().map(|(_, buffer)| buffer.held()).sum()
    }
}

/// Buffers of a kind and size that are not in use. With as many as submissions may be under way, one is free for the next; most
/// of the time one will do. For a large one it is waited.
fn most_spare(bytes: u64) -> usize {
    if bytes < Sent::LARGE {
        FRAMES_IN_FLIGHT
    } else {
        1
    }
}

/// Sends things of one kind, which differ little in size.
pub(crate) struct Sender {
    what: Sent,
    gpu: Arc<Gpu>,
    /// Buffers that are not in use.
    pub(crate) free: Pool,
    staging: Pool,
    /// Bytes of what was sent last.
    last: u64,
}

/// Where copies run, and what tells how far submissions are.
type Road<'a> = (&'a mut Transfer, &'a Timeline);

/// Memory of the host that something is sent from.
pub struct Staging {
    buffer: Buffer,
    /// Of what is there.
    bytes: u64,
}

impl Staging {
    /// Writes part by part, by all threads; says whether there is room.
    pub(crate) fn fill(&mut self, parts: &[&[u32]]) -> bool {
        self.bytes = bytes(parts);
        if self.bytes > self.buffer.bytes {
            return false;
        }
        let mut to = self.buffer.view_mut();
        for part in parts {
            let (of_part, rest) = to.split_at_mut(part.len());
            let runs = of_part.par_chunks_mut(RUN).zip(part.par_chunks(RUN));
            runs.for_each(|(to, from)| to.copy_from_slice(from));
            to = rest;
        }
        true
    }
}

/// Words that one task copies.
const RUN: usize = 1 << 17;

fn bytes(parts: &[&[u32]]) -> u64 {
    parts.iter().map(|part| size_of_val(*part) as u64).sum()
}

impl Sender {
    /// One a [`Sent`].
    pub(crate) fn all(gpu: &Arc<Gpu>) -> [Self; 2] {
        [Sent::Tree, Sent::KeyFrame].map(|what| Self {
            what,
            gpu: Arc::clone(gpu),
            free: Pool::default(),
            staging: Pool::default(),
            last: 0,
        })
    }

    /// Memory to send from, with room for as much as was sent last; none before.
    pub(crate) fn staging(&mut self, done: Done<'_>) -> Result<Option<Staging>> {
        match self.last {
            0 => Ok(None),
            bytes => self.room(done, bytes).map(Some),
        }
    }

    fn room(&mut self, done: Done<'_>, bytes: u64) -> Result<Staging> {
        let spare = self.staging.take(done, most_spare(bytes))?;
        let made = || self.buffer(bytes, BufferUse::Staging);
        let buffer = spare.filter(|b| b.bytes >= bytes).map_or_else(made, Ok)?;
        Ok(Staging { buffer, bytes: 0 })
    }

    fn buffer(&self, bytes: u64, place: BufferUse) -> Result<Buffer> {
        let (what, room) = (self.what.what(), self.what.room(bytes));
        Buffer::new(&self.gpu, what, room, place)
    }

    /// Begins to send something part by part. Gives its buffer, and the value of the copy.
    pub(crate) fn send(&mut self, road: Road<'_>, parts: &[&[u32]]) -> Result<(Buffer, u64)> {
        let mut staging = self.room((road.0, road.1), bytes(parts))?;
        staging.fill(parts);
        self.send_filled(road, staging)
    }

    /// Likewise, of what is written already.
    pub(crate) fn send_filled(
        &mut self,
        road: Road<'_>,
        Staging { buffer, bytes }: Staging,
    ) -> Result<(Buffer, u64)> {
        let sent = self.send_from(road, (&buffer, bytes), None)?;
        let (filled_at, ticket) = (sent.1, 0);
        self.staging.put(buffer, LastUse { filled_at, ticket });
        self.last = bytes;
        Ok(sent)
    }

    /// Likewise, from memory that is not written until the copy is done. A buffer that held another thing of the kind gets only
    /// the bytes that are `new`.
    pub(crate) fn send_from(
        &mut self,
        (road, submissions): Road<'_>,
        (from, bytes): (&Buffer, u64),
        new: Option<&[Range<u64>]>,
    ) -> Result<(Buffer, u64)> {
        let all = 0..bytes;
        let all = std::slice::from_ref(&all);
        let spare = self.free.take((road, submissions), most_spare(bytes))?;
        let (to, new) = match spare.filter(|b| b.bytes >= bytes) {
            Some(held_another) => (held_another, new.unwrap_or(all)),
            None => (self.buffer(bytes, BufferUse::Device)?, all),
        };
        let filled_at = road.start_ranges([from, &to], new)?;
        Ok((to, filled_at))
    }

    /// Bytes of what is not in use, and of what things are sent from.
    pub(crate) fn held(&self) -> [u64; 2] {
        [self.free.held(), self.staging.held()]
    }
}
