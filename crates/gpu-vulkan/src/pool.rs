//! Buffers that wait until nothing uses them any more, to be used again or dropped.

use crate::memory::Buffer;
use crate::timeline::Timeline;
use backend::Result;

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
