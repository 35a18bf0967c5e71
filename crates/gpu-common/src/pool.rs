//! Buffers that wait for their last use to finish before they are reused or dropped.

use crate::BufferSize;
use backend::{FRAMES_IN_FLIGHT, Result};

/// Minimum bytes of a large buffer. Fewer large buffers are kept, because their memory costs more than a wait.
pub(crate) const LARGE: u64 = 64 << 20;

/// Creates a buffer of `bytes` plus slack, or of exactly `bytes` if that fails. With slack the next tree fits too,
/// because trees of one scene have similar sizes.
pub fn with_slack<B>(bytes: u64, make: impl Fn(u64) -> Result<B>) -> Result<B> {
    make(bytes + bytes / 32).or_else(|_| make(bytes))
}

/// Last use of a buffer: by a submission, and by an [upload](crate::GpuDevice::send) to it or from it. A number is 0 if
/// there was no such use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct LastUse {
    /// Number of the upload.
    pub upload_value: u64,
    /// Ticket of the submission.
    pub ticket: u64,
}

impl LastUse {
    /// Returns the use by an upload only.
    pub fn by_upload(upload_value: u64) -> Self {
        Self {
            upload_value,
            ticket: 0,
        }
    }
}

/// Buffers of one kind with their last uses.
pub struct Pool<B>(Vec<PooledBuffer<B>>);

struct PooledBuffer<B> {
    buffer: B,
    size: BufferSize,
    last: LastUse,
}

impl<B> Default for Pool<B> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<B> Pool<B> {
    /// Adds a buffer.
    pub fn put(&mut self, buffer: B, size: BufferSize, last: LastUse) {
        self.0.push(PooledBuffer { buffer, size, last });
    }

    /// Removes a buffer whose last use has ended, and returns it if it has at least `bytes`. Drops a smaller one and
    /// returns `None`. If all buffers are in use, a full pool waits for the earliest use. A pool that is not full
    /// returns `None`. `has_ended` returns whether a use has ended. It may wait first if its second argument is set.
    pub fn fit(
        &mut self,
        bytes: u64,
        has_ended: impl Fn(LastUse, bool) -> Result<bool>,
    ) -> Result<Option<B>> {
        // With as many buffers as unfinished submissions, the wait is short. Large buffers are limited to one.
        let most = if bytes < LARGE { FRAMES_IN_FLIGHT } else { 1 };
        let spare = self.take(most, has_ended)?;
        Ok(spare
            .filter(|spare| spare.size.bytes >= bytes)
            .map(|spare| spare.buffer))
    }

    fn take(
        &mut self,
        most: usize,
        has_ended: impl Fn(LastUse, bool) -> Result<bool>,
    ) -> Result<Option<PooledBuffer<B>>> {
        for i in 0..self.0.len() {
            if has_ended(self.0[i].last, false)? {
                return Ok(Some(self.0.remove(i)));
            }
        }
        let all = self.0.iter().enumerate();
        match all.min_by_key(|(_, spare)| spare.last) {
            Some((i, spare)) if self.0.len() >= most && has_ended(spare.last, true)? => {
                Ok(Some(self.0.remove(i)))
            }
            _ => Ok(None),
        }
    }

    /// Returns the bytes of device memory.
    pub fn held(&self) -> u64 {
        self.0.iter().map(|spare| spare.size.allocated).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::BackendError;

    #[test]
    fn falls_back_to_size_without_slack() {
        let within = |limit: u64| {
            with_slack(3200, |bytes| match bytes <= limit {
                true => Ok(bytes),
                false => Err(BackendError::NoDevice(String::new())),
            })
        };
        assert_eq!(
            [3300, 3299].map(|limit| within(limit).ok()),
            [Some(3300), Some(3200)]
        );
        assert!(within(3199).is_err());
    }
}
