//! Closed bodies: what must not leak and must not be hit twice.

use crate::leaks::{self, Aim, RayBatch};
use crate::stress::scenes::Scene;
use backend::Method;

/// Bodies there are; a family has each of them several times.
const BODIES: usize = 4;

/// Aims times sides.
const SORTS: usize = 6;

/// Closed bodies at an offset, all rays of them or those with one aim, so many at each body.
pub(crate) fn scenes(offset: f32, aim: Option<Aim>, seed: u64, shares: &[usize]) -> Vec<Scene> {
    let batches = shares.chunks(BODIES).enumerate();
    let scenes = batches.flat_map(|(batch, shares)| {
        let most = shares.iter().max().copied().unwrap_or(0).max(1);
        let sorts = if aim.is_some() { 3 } else { 1 };
        let plan = leaks::LeakPlan {
            seed: mixed(seed) ^ batch as u64,
            // Twice as many as needed: far away, some begin where they are aimed at.
            rays: (2 * (most + SORTS) * sorts * BODIES) as u64,
            offsets: vec![offset],
            method: Method::default(),
        };
        let ray_batches = leaks::ray_batches(&plan);
        ray_batches
            .into_iter()
            .zip(shares.to_vec())
            .map(move |(ray_batches, share)| scene(ray_batches, aim, batch, share))
    });
    scenes.collect()
}

/// Each batch begins with another sort of ray, so that few rays are of all sorts too.
fn scene(ray_batches: RayBatch, aim: Option<Aim>, batch: usize, share: usize) -> Scene {
    let sorted = ray_batches.rays.into_iter().enumerate();
    let sorted = sorted.map(|(i, ray)| (RayBatch::sort(i), ray));
    let wanted = sorted.filter(|((a, _), ray)| ray.is_valid() && aim.is_none_or(|aim| aim == *a));
    let (inside, rays) = wanted
        .map(|((_, inside), ray)| (inside, ray))
        .skip(batch % SORTS)
        .take(share)
        .unzip();
    Scene {
        animation: ray_batches.animation,
        built: 0.0,
        time: 0.0,
        rays,
        inside: Some(inside),
    }
}

/// Bodies so far away that rounding moves their walls past what was inside.
pub(crate) fn no_longer(scenes: Vec<Scene>) -> Vec<Scene> {
    let open = |s| Scene { inside: None, ..s };
    scenes.into_iter().map(open).collect()
}

/// A number at random that depends on `x` alone.
fn mixed(x: u64) -> u64 {
    fastrand::Rng::with_seed(x).u64(..)
}
