//! Scenes, rays and trees to test backends with, shared by properties and stability tests.
//!
//! They are the same on every machine: sines, cosines and powers of ten are those of `libm`.

pub(crate) mod bodies;
pub(crate) mod cases;
pub(crate) mod commands;
pub(crate) mod meshes;
pub(crate) mod rays;
pub(crate) mod scenes;
pub(crate) mod strategies;
pub(crate) mod topologies;

use fastrand::Rng;

/// Returns a pseudorandom number that depends only on `x`.
pub(crate) fn mixed(x: u64) -> u64 {
    Rng::with_seed(x).u64(..)
}

/// Splits `total` into `count` shares that differ by at most one, the larger ones first.
pub(crate) fn shares(total: u64, count: u64) -> impl Iterator<Item = u64> {
    (0..count).map(move |i| total / count + u64::from(i < total % count))
}
