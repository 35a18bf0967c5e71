//! Positions for builders, in buffers that come back.

use backend::{Snapshot, Ticket};
use geom::Point;
use std::collections::VecDeque;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

type Spares = Arc<Mutex<Vec<Vec<Point>>>>;

/// Copies requested and not taken yet, and buffers that builders gave back.
#[derive(Debug, Default)]
pub(crate) struct Snapshots {
    ready: VecDeque<(Ticket, Vec<Point>)>,
    spares: Spares,
}

impl Snapshots {
    /// A buffer that was given back, or a new one.
    pub(crate) fn buffer(&self) -> Vec<Point> {
        let mut spares = self.spares.lock().unwrap_or_else(PoisonError::into_inner);
        spares.pop().unwrap_or_default()
    }

    pub(crate) fn push(&mut self, ticket: Ticket, positions: Vec<Point>) {
        self.ready.push_back((ticket, positions));
    }

    /// The oldest copy.
    pub(crate) fn pop(&mut self) -> Option<(Ticket, Snapshot)> {
        let (ticket, positions) = self.ready.pop_front()?;
        let home = Arc::clone(&self.spares);
        Some((ticket, Box::new(Lent { positions, home })))
    }
}

/// Positions that go home when dropped.
struct Lent {
    positions: Vec<Point>,
    home: Spares,
}

impl Deref for Lent {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        &self.positions
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        let positions = std::mem::take(&mut self.positions);
        let mut spares = self.home.lock().unwrap_or_else(PoisonError::into_inner);
        spares.push(positions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_comes_back_when_its_reader_is_done() {
        let mut snapshots = Snapshots::default();
        snapshots.push(Ticket(3), vec![[1.0; 3]; 9]);
        let (ticket, lent) = snapshots.pop().unwrap();
        assert_eq!((ticket, lent.len()), (Ticket(3), 9));
        assert_eq!(snapshots.buffer().capacity(), 0);
        drop(lent);
        assert!(snapshots.buffer().capacity() >= 9);
        assert!(snapshots.pop().is_none());
    }
}
