//! Copies of positions for the builder.

use crate::{GpuDevice, PendingWork};
use backend::{Result, Snapshot, Ticket};
use std::collections::VecDeque;

/// Requests of positions and their copies.
#[derive(Default)]
pub(crate) struct Snapshots {
    /// Index of the position buffer that the recording requested.
    pub(crate) requested: Option<usize>,
    /// Copies that [`Snapshots::take`] has not returned yet, in order: submission and index of the position buffer.
    unfinished: VecDeque<(Ticket, usize)>,
}

impl Snapshots {
    /// Notes that the recording requests these positions.
    ///
    /// # Panics
    /// If the recording has a request already.
    pub(crate) fn request(&mut self, position: usize) {
        let requested = self.requested.replace(position);
        assert!(requested.is_none(), "positions are already requested");
    }

    /// Returns the index of the position buffer that the next interpolation writes. If this buffer is being copied,
    /// also returns the submission whose copy must finish first.
    pub(crate) fn position_to_write<D: GpuDevice>(
        &self,
        gpu: &D,
        current: usize,
    ) -> Result<(usize, Option<Ticket>)> {
        let mut busy_until = [None; 2];
        for (i, (ticket, position)) in self.unfinished.iter().enumerate() {
            if !gpu.has_finished(PendingWork::Positions(*ticket))? {
                busy_until[*position] = Some(i);
            }
        }
        let (position, busy) = first_free(current, self.requested, busy_until);
        Ok((position, busy.map(|i| self.unfinished[i].0)))
    }

    /// Notes that the recording was submitted.
    pub(crate) fn submitted(&mut self, ticket: Ticket) {
        let requested = self.requested.take();
        let unfinished = requested.map(|position| (ticket, position));
        self.unfinished.extend(unfinished);
    }

    /// Forgets the copies of these submissions, which never run.
    pub(crate) fn remove(&mut self, dropped: &[Ticket]) {
        self.unfinished.retain(|(of, _)| !dropped.contains(of));
    }

    /// Returns the oldest positions if they have arrived.
    pub(crate) fn take<D: GpuDevice>(
        &mut self,
        gpu: &mut D,
        vertices: usize,
    ) -> Result<Option<(Ticket, Snapshot)>> {
        let Some(&(ticket, _)) = self.unfinished.front() else {
            return Ok(None);
        };
        if !gpu.has_finished(PendingWork::Positions(ticket))? {
            return Ok(None);
        }
        self.unfinished.pop_front();
        Ok(Some((ticket, gpu.take_positions(ticket, vertices)?)))
    }
}

/// Returns the position buffer that is free first, and the index of the copy it waits for. Prefers the current buffer
/// and never returns the one `requested` in this recording.
fn first_free(
    current: usize,
    requested: Option<usize>,
    busy_until: [Option<usize>; 2],
) -> (usize, Option<usize>) {
    [current, 1 - current]
        .into_iter()
        .filter(|&p| requested != Some(p))
        .map(|p| (p, busy_until[p]))
        .min_by_key(|&(_, busy)| busy)
        .expect("at most one of two is requested")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_the_buffer_freed_first() {
        assert_eq!(first_free(1, None, [None, None]), (1, None));
        assert_eq!(first_free(1, None, [None, Some(3)]), (0, None));
        assert_eq!(first_free(1, Some(1), [Some(3), None]), (0, Some(3)));
        assert_eq!(first_free(0, None, [Some(5), Some(4)]), (1, Some(4)));
        assert_eq!(first_free(0, Some(1), [Some(5), None]), (0, Some(5)));
    }
}
