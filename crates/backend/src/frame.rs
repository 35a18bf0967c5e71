//! Reports of submissions, and positions that builders borrow.

use geom::{Point, lock};
use serde::{Deserialize, Serialize, Serializer};
use std::ops::Deref;
use std::sync::{Arc, Mutex};

/// Number of a submission of one backend. Submissions finish in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u64);

/// Number of a tree. It must be higher than that of the tree adopted before. The first number is at least 1, because 0
/// means that there is no tree.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Generation(pub u64);

/// Read-only positions that a builder thread borrows. Dropping the snapshot returns their memory to its pool.
pub type Snapshot = Box<dyn Deref<Target = [Point]> + Send + Sync>;

/// Pool of memory for positions. Memory returns to it once its reader has finished.
#[derive(Debug)]
pub struct Spares<T>(Arc<Mutex<Vec<T>>>);

impl<T> Default for Spares<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Deref<Target = [Point]> + Send + Sync + 'static> Spares<T> {
    /// Returns memory that a reader has finished with, if any.
    #[must_use]
    pub fn pop(&self) -> Option<T> {
        lock(&self.0).pop()
    }

    /// Lends positions. Their memory returns to the pool when the snapshot is dropped.
    #[must_use]
    pub fn lend(&self, positions: T) -> Snapshot {
        Box::new(LentPositions {
            positions: Some(positions),
            pool: Arc::clone(&self.0),
        })
    }
}

struct LentPositions<T> {
    /// `None` once the memory was returned.
    positions: Option<T>,
    pool: Arc<Mutex<Vec<T>>>,
}

impl<T: Deref<Target = [Point]>> Deref for LentPositions<T> {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        self.positions
            .as_ref()
            .expect("positions are returned only on drop")
    }
}

impl<T> Drop for LentPositions<T> {
    fn drop(&mut self) {
        let mut pool = lock(&self.pool);
        pool.extend(self.positions.take());
    }
}

/// Milliseconds of each stage; `None` for a stage that the submission skipped, or if the device has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Interpolation of key frames to positions. Also `None` if it ran at the same time as `preprocess`, whose time
    /// then includes both.
    #[serde(serialize_with = "rounded")]
    pub interpolate_ms: Option<f64>,
    /// Computation of triangle records and boxes of leaves from positions or from key frames. Most devices also compute
    /// some or all boxes of inner nodes here. Includes the same work for a candidate tree. On the host, includes the
    /// whole evaluation of the candidate.
    #[serde(serialize_with = "rounded")]
    pub preprocess_ms: Option<f64>,
    /// Tree build on the device, except for triangle records and boxes of leaves.
    #[serde(serialize_with = "rounded")]
    pub rebuild_ms: Option<f64>,
    /// Computation of the remaining boxes of inner nodes, on GPUs also of a candidate tree.
    #[serde(serialize_with = "rounded")]
    pub refit_ms: Option<f64>,
    /// Trace of the primary or given rays. Includes shadow rays if one kernel traces both.
    #[serde(serialize_with = "rounded")]
    pub trace_primary_ms: Option<f64>,
    /// Trace of shadow rays. Also `None` if `trace_primary_ms` includes it.
    #[serde(serialize_with = "rounded")]
    pub trace_shadow_ms: Option<f64>,
    /// From the start of the first stage to the end of the last, by the device's clock. Without timestamps, from the
    /// submission until the host noticed its end.
    #[serde(serialize_with = "rounded")]
    pub device_ms: f64,
}

/// Times and counts of one submission. The command-line program writes them to its statistics file under these names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// Time of each stage.
    #[serde(flatten)]
    pub times: StageTimes,
    /// Rays that hit a triangle.
    pub hits: u64,
    /// Hits in shadow.
    pub blocked: u64,
    /// Rays and shadow rays that were tested in exact arithmetic. With `watertight`, these are the
    /// [extreme](geom::CoordinateRange::is_extreme) rays and their shadow rays. `exact` adds those that error bounds
    /// could not decide. If a camera ray is undecided, GPUs do not count its shadow ray. With other intersectors 0.
    pub exact_rays: u64,
    /// Inactive triangles: those with an infinite or NaN coordinate at the traced positions.
    pub inactive: u64,
    /// Triangles that are active but have zero area at the traced positions.
    pub degenerate: u64,
    /// Cost of the refitted tree by the surface area heuristic (traversal 1, intersection 1), if the backend measures
    /// it.
    #[serde(serialize_with = "rounded")]
    pub sah_cost: Option<f64>,
    /// Cost of the [candidate tree](crate::Backend::evaluate), at the same positions as `sah_cost`.
    #[serde(skip)]
    pub candidate_cost: Option<f64>,
    /// Bytes of positions copied to the host, for a builder or to measure their range.
    pub readback_bytes: u64,
}

/// Serializes a number, if known, rounded to six decimals. For times in milliseconds, this is one nanosecond.
///
/// # Errors
/// Those of the serializer.
pub fn rounded<S: Serializer>(
    number: &(impl Into<Option<f64>> + Copy),
    to: S,
) -> Result<S::Ok, S::Error> {
    let number: Option<f64> = (*number).into();
    number.map(|x| (x * 1e6).round() / 1e6).serialize(to)
}

/// Returns a tree's cost by the surface area heuristic (traversal 1, intersection 1; MacDonald, Booth 1990): the sum of
/// all nodes' areas divided by the root's area. Returns `None` if the root's area is 0 or the sum overflows.
#[must_use]
pub fn sah_cost(areas: f64, root: f64) -> Option<f64> {
    let cost = areas / root;
    (root > 0.0 && cost.is_finite()).then_some(cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lent_memory_returns_when_dropped() {
        let spares = Spares::default();
        let lent = spares.lend(vec![[1.0; 3]; 9]);
        assert_eq!(lent[..], [[1.0; 3]; 9]);
        assert_eq!(spares.pop(), None);
        drop(lent);
        assert_eq!(spares.pop().map(|positions| positions.len()), Some(9));
    }
}
