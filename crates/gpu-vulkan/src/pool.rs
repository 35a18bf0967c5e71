//! Buffers that wait until nothing uses them any more, to be used again or dropped; and what fills them beside the frames.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::timeline::Timeline;
use crate::transfer::{Copy, Transfer};
use backend::{FRAMES_IN_FLIGHT, Result};
use gpu_common::Sent;
use std::sync::Arc;

/// What was recorded or submitted when a buffer was given up: a ticket, and an upload's value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LastUse {
    pub(crate) filled_at: u64,
    pub(crate) ticket: u64,
}

/// What tells how far uploads and submissions are.
#[derive(Clone, Copy)]
pub(crate) struct Done<'a> {
    pub(crate) uploads: &'a Timeline,
    pub(crate) submissions: &'a Timeline,
}

impl Done<'_> {
    fn has_passed(self, last: LastUse) -> Result<bool> {
        Ok(self.submissions.has_reached(last.ticket)?
            && self.uploads.has_reached(last.filled_at)?)
    }

    fn wait(self, last: LastUse) -> Result<()> {
        self.submissions.wait(last.ticket)?;
        self.uploads.wait(last.filled_at)
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
            if done.has_passed(self.0[i].0)? {
                return Ok(Some(self.0.remove(i).1));
            }
        }
        let all = self.0.iter().enumerate();
        let first = all.min_by_key(|(_, (last, _))| *last);
        let Some((i, &(last, _))) = first.filter(|_| self.0.len() >= most) else {
            return Ok(None);
        };
        done.wait(last)?;
        Ok(Some(self.0.remove(i).1))
    }

    /// Drops what nothing uses.
    pub(crate) fn prune(&mut self, done: Done<'_>) -> Result<()> {
        let mut kept = Vec::new();
        for (last, buffer) in self.0.drain(..) {
            if !done.has_passed(last)? {
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

/// Buffers of a kind that are not in use. With as many, one is free for the next whatever is under way; most of the time
/// one will do.
const SPARE: usize = FRAMES_IN_FLIGHT;

/// Sends things of one kind, which differ little in size.
#[derive(Default)]
pub(crate) struct Sender {
    free: Pool,
    staging: Pool,
}

impl Sender {
    /// Begins to send something part by part. Gives its buffer, and the value of the copy.
    pub(crate) fn send(
        &mut self,
        gpu: &Arc<Gpu>,
        (road, submissions): (&mut Transfer, &Timeline),
        (what, parts): (Sent, &[&[u32]]),
    ) -> Result<(Buffer, u64)> {
        let bytes: u64 = parts.iter().map(|p| size_of_val(*p) as u64).sum();
        let done = Done {
            uploads: &road.done,
            submissions,
        };
        let fit = |pool: &mut Pool, place| {
            let spare = pool.take(done, SPARE)?;
            match spare.filter(|b| b.bytes >= bytes) {
                Some(buffer) => Ok(buffer),
                None => Buffer::new(gpu, what.what(), what.room(bytes), place),
            }
        };
        let to = fit(&mut self.free, BufferUse::Device)?;
        let mut staging = fit(&mut self.staging, BufferUse::Staging)?;
        let mut at = 0;
        for words in parts {
            staging.write(at, words);
            at += size_of_val(*words) as u64;
        }
        let copy = Copy {
            from: &staging,
            to: &to,
            to_at: 0,
            bytes,
        };
        let filled_at = road.start(copy, None)?;
        let ticket = 0;
        self.staging.put(staging, LastUse { filled_at, ticket });
        Ok((to, filled_at))
    }

    /// Takes back a buffer.
    pub(crate) fn recycle(&mut self, buffer: Buffer, last: LastUse) {
        self.free.put(buffer, last);
    }

    /// Bytes of what is not in use, and of what things are sent from.
    pub(crate) fn held(&self) -> [u64; 2] {
        [self.free.held(), self.staging.held()]
    }
}
