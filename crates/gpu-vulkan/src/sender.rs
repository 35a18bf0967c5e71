//! Buffers that are filled beside the frames, and used again.

use crate::gpu::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::pool::{Done, LastUse, Pool};
use crate::timeline::Timeline;
use crate::transfer::{Copy, Transfer};
use backend::{FRAMES_IN_FLIGHT, Result};
use gpu_common::Sent;
use std::sync::Arc;

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
        // Somewhat larger than needed: trees of one scene differ little, key frames not at all.
        let room = match what {
            Sent::Tree => bytes + bytes / 32,
            Sent::KeyFrame => bytes,
        };
        let done = Done {
            uploads: &road.done,
            submissions,
        };
        let fit = |pool: &mut Pool, place| {
            let spare = pool.take(done, SPARE)?;
            match spare.filter(|b| b.bytes >= bytes) {
                Some(buffer) => Ok(buffer),
                None => Buffer::new(gpu, what.what(), room, place),
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
