//! Copies of positions for the builder.

use crate::GpuDevice;
use backend::{Result, Snapshot, Ticket};
use std::collections::VecDeque;

/// Requests of positions and their copies.
pub(crate) struct Snapshots<D: GpuDevice> {
    /// Index of the position buffer that the recording requested.
    pub(crate) requested: Option<usize>,
    /// In the order of the requests, which is that of the copies.
    under_way: VecDeque<(Ticket, usize, D::Copy)>,
}

impl<D: GpuDevice> Default for Snapshots<D> {
    fn default() -> Self {
        Self {
            requested: None,
            under_way: VecDeque::new(),
        }
    }
}

impl<D: GpuDevice> Snapshots<D> {
    /// Notes that the recording requests these positions.
    ///
    /// # Panics
    /// If the recording has a request already.
    pub(crate) fn request(&mut self, position: usize) {
        let requested = self.requested.replace(position);
        assert!(requested.is_none(), "one request of positions a submission");
    }

    /// Returns the index of the position buffer that the next interpolation writes. If both are being read, the device
    /// makes the interpolation wait.
    pub(crate) fn position_to_write(&self, gpu: &mut D, current: usize) -> Result<usize> {
        let mut busy_until = [None; 2];
        for (i, (_, position, copy)) in self.under_way.iter().enumerate() {
            if !gpu.has_arrived(copy)? {
                busy_until[*position] = Some(i);
            }
        }
        let (position, busy) = soonest(current, self.requested, busy_until);
        if let Some(i) = busy {
            gpu.overwrites(&self.under_way[i].2);
        }
        Ok(position)
    }

    /// Notes that the recording was submitted with this copy.
    pub(crate) fn submitted(&mut self, ticket: Ticket, copy: Option<D::Copy>) {
        let requested = self.requested.take().zip(copy);
        let under_way = requested.map(|(position, copy)| (ticket, position, copy));
        self.under_way.extend(under_way);
    }

    /// Drops the copies of these submissions, which never run.
    pub(crate) fn give_up(&mut self, dropped: &[Ticket]) {
        self.under_way.retain(|(of, ..)| !dropped.contains(of));
    }

    /// Returns the oldest positions if they have arrived.
    pub(crate) fn take(
        &mut self,
        gpu: &mut D,
        vertices: usize,
    ) -> Result<Option<(Ticket, Snapshot)>> {
        match self.under_way.front() {
            Some((.., copy)) if gpu.has_arrived(copy)? => (),
            _ => return Ok(None),
        }
        let oldest = self.under_way.pop_front();
        let (ticket, _, copy) = oldest.expect("it was there a moment ago");
        Ok(Some((ticket, gpu.take(copy, vertices)?)))
    }
}

/// Returns the position buffer that is free first, and the index of the copy it waits for. Prefers the current buffer
/// and never returns the one `requested` in this recording.
fn soonest(
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
    fn positions_are_written_where_nobody_reads_or_where_reading_ends_first() {
        assert_eq!(soonest(1, None, [None, None]), (1, None));
        assert_eq!(soonest(1, None, [None, Some(3)]), (0, None));
        assert_eq!(soonest(1, Some(1), [Some(3), None]), (0, Some(3)));
        assert_eq!(soonest(0, None, [Some(5), Some(4)]), (1, Some(4)));
        assert_eq!(soonest(0, Some(1), [Some(5), None]), (0, Some(5)));
    }
}
