//! What a backend says of its work, and positions that it lends to whoever builds trees.

use geom::{Point, lock};
use std::ops::Deref;
use std::sync::{Arc, Mutex};

/// A point in one backend's order of submissions. Tickets finish in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

/// Which build a tree came from. Strictly rises with each adoption.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Generation(pub u64);

/// Positions on their way to a builder: read-only, sendable, given back when dropped.
pub type Snapshot = Box<dyn Deref<Target = [Point]> + Send + Sync>;

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
        lock(&self.0).pop()
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
        let mut home = lock(&self.home);
        home.extend(self.positions.take());
    }
}

/// Milliseconds of each stage; `None` for a stage that the submission left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Key frames to positions; `None` also where they ran beside `preprocess`, whose time then holds both.
    pub interpolate_ms: Option<f64>,
    /// Positions to records and boxes of leaves, or key frames to these and to positions.
    pub preprocess_ms: Option<f64>,
    /// Positions to a tree made on the device, but for records and boxes of leaves.
    pub rebuild_ms: Option<f64>,
    /// Boxes of leaves to boxes of inner nodes.
    pub refit_ms: Option<f64>,
    /// Primary or given rays; their shadow rays too, where one kernel traces both.
    pub trace_primary_ms: Option<f64>,
    /// Shadow rays; `None` also where the primary rays' time holds theirs.
    pub trace_shadow_ms: Option<f64>,
    /// From the first stage's start to the last one's end, by the device's clock.
    pub device_ms: f64,
    /// When the first stage began, by the device's clock, whose zero is
    /// arbitrary but the same for all submissions; `None` where there is no such clock.
    pub begun_ms: Option<f64>,
}

/// What one submission did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// How long it took.
    pub times: StageTimes,
    /// Rays that hit; with [`crate::QueryKind::Any`], rays that met anything.
    pub hits: u64,
    /// Hits in shadow.
    pub blocked: u64,
    /// Rays, shadow rays included, that error bounds left open and exact
    /// arithmetic settled; 0 unless the intersector is `exact`.
    pub settled: u64,
    /// Triangles inactive at the positions traced.
    pub inactive: u64,
    /// Triangles active but of zero area at the positions traced.
    pub degenerate: u64,
    /// Cost of the refitted tree by the surface area heuristic (traversal 1,
    /// intersection 1), where the backend measures it.
    pub sah_cost: Option<f64>,
    /// Cost of the tree that the submission [evaluated](crate::Backend::evaluate), at the same positions as `sah_cost`.
    pub candidate_cost: Option<f64>,
    /// Bytes that went back to the host for a builder.
    pub readback_bytes: u64,
}

/// A tree's cost by the surface area heuristic (traversal 1, intersection 1; MacDonald, Booth 1990): all nodes' areas over the
/// root's. `None` if the root has no area, or areas were too large to be added up.
#[must_use]
pub fn sah_cost(areas: f64, root: f64) -> Option<f64> {
    let cost = areas / root;
    (root > 0.0 && cost.is_finite()).then_some(cost)
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
