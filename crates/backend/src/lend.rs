//! Positions lent to whoever builds trees, in memory that comes back.

use crate::Snapshot;
use geom::Point;
use std::ops::Deref;
use std::sync::{Arc, Mutex, PoisonError};

/// Memory for positions, to be used again once its reader is done.
#[derive(Debug)]
pub struct Spares<T>(Arc<Mutex<Vec<T>>>);

impl<T> Default for Spares<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Deref<Target = [Point]> + Send + Sync + 'static> Spares<T> {
    /// Memory that came back.
    #[must_use]
    pub fn pop(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    /// Lends positions; their memory comes back when the snapshot is dropped.
    #[must_use]
    pub fn lend(&self, positions: T) -> Snapshot {
        Box::new(Lent {
            positions: Some(positions),
            home: Arc::clone(&self.0),
        })
    }
}

struct Lent<T> {
    /// Taken out when the loan ends.
    positions: Option<T>,
    home: Arc<Mutex<Vec<T>>>,
}

impl<T: Deref<Target = [Point]>> Deref for Lent<T> {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        self.positions
            .as_ref()
            .expect("they stay until the loan ends")
    }
}

impl<T> Drop for Lent<T> {
    fn drop(&mut self) {
        let mut home = self.home.lock().unwrap_or_else(PoisonError::into_inner);
        home.extend(self.positions.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_comes_back_when_its_reader_is_done() {
        let spares = Spares::default();
        let lent = spares.lend(vec![[1.0; 3]; 9]);
        assert_eq!(lent[..], [[1.0; 3]; 9]);
        assert_eq!(spares.pop(), None);
        drop(lent);
        assert_eq!(spares.pop().map(|positions| positions.len()), Some(9));
    }
}
