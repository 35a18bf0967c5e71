//! Scenes, rays and trees to try backends on: one set for laws, leaks, stress tests and audits.

pub(crate) mod bodies;
pub(crate) mod cases;
pub(crate) mod meshes;
pub(crate) mod rays;
pub(crate) mod scenes;
pub(crate) mod topologies;

use fastrand::Rng;

/// A number at random that depends on `x` alone.
pub(crate) fn mixed(x: u64) -> u64 {
    Rng::with_seed(x).u64(..)
}

/// Shares `total` out among `count`, the first of which may get one more.
pub(crate) fn shares(total: u64, count: u64) -> impl Iterator<Item = u64> {
    (0..count).map(move |i| total / count + u64::from(i < total % count))
}
