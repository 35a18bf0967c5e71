//! Buffers that wait until nothing uses them any more, to be used again or dropped.

use crate::GpuDevice;
use backend::{FRAMES_IN_FLIGHT, Result};

/// Bytes from which on few buffers are kept at a time, for their memory counts more than a wait.
pub(crate) const LARGE: u64 = 64 << 20;

/// Makes a buffer of so many bytes and some to spare, so that the next tree fits too: trees of one scene differ little. Where
/// the device has no more, of as many.
pub fn with_slack<B>(bytes: u64, make: impl Fn(u64) -> Result<B>) -> Result<B> {
    make(bytes + bytes / 32).or_else(|_| make(bytes))
}

/// What uses a buffer last: a ticket, and the number of what was [sent](GpuDevice::send) to it or from it; 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct LastUse {
    /// Of what was sent.
    pub arrival: u64,
    /// Of a submission.
    pub ticket: u64,
}

/// Buffers of one kind with their last use.
pub struct Pool<D: GpuDevice>(Vec<(LastUse, D::Buffer)>);

impl<D: GpuDevice> Default for Pool<D> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<D: GpuDevice> Pool<D> {
    /// Takes a buffer back.
    pub fn put(&mut self, buffer: D::Buffer, last: LastUse) {
        self.0.push((last, buffer));
    }

    /// A buffer of at least so many bytes, and whether it held another thing. If none is free, or one that is too small,
    /// another is made; of many or large ones it is waited for one. See [`GpuDevice::has_ended`].
    pub fn fit(
        &mut self,
        bytes: u64,
        has_ended: impl Fn(LastUse, bool) -> Result<bool>,
        make: impl FnOnce() -> Result<D::Buffer>,
    ) -> Result<(D::Buffer, bool)> {
        // With as many as submissions may be under way, one is free for the next; most of the time one will do.
        let most = if bytes < LARGE { FRAMES_IN_FLIGHT } else { 1 };
        let spare = self.take(most, has_ended)?;
        match spare.filter(|buffer| D::size(buffer) >= bytes) {
            Some(buffer) => Ok((buffer, true)),
            None => Ok((make()?, false)),
        }
    }

    fn take(
        &mut self,
        most: usize,
        has_ended: impl Fn(LastUse, bool) -> Result<bool>,
    ) -> Result<Option<D::Buffer>> {
        for i in 0..self.0.len() {
            if has_ended(self.0[i].0, false)? {
                return Ok(Some(self.0.remove(i).1));
            }
        }
        let all = self.0.iter().enumerate();
        match all.min_by_key(|(_, (last, _))| *last) {
            Some((i, &(last, _))) if self.0.len() >= most && has_ended(last, true)? => {
                Ok(Some(self.0.remove(i).1))
            }
            _ => Ok(None),
        }
    }

    /// Drops what nothing uses.
    pub fn prune(&mut self, has_ended: impl Fn(LastUse) -> Result<bool>) -> Result<()> {
        let mut at = 0;
        while let Some((last, _)) = self.0.get(at) {
            match has_ended(*last)? {
                true => drop(self.0.remove(at)),
                false => at += 1,
            }
        }
        Ok(())
    }

    /// Bytes of device memory.
    pub fn held(&self) -> u64 {
        self.0.iter().map(|(_, buffer)| D::held(buffer)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::BackendError;

    #[test]
    fn where_there_is_no_slack_the_bytes_are_enough() {
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
