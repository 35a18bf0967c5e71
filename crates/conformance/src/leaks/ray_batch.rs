//! The same bodies and rays, for those who judge by something else than parity alone.

use super::LeakPlan;
use super::aim::{Aim, sort_of};
use super::batches::specs;
use super::bodies::BODIES;
use geom::{Animation, Ray};
use std::sync::Arc;

/// A closed body that stands still, and rays at it.
#[derive(Clone, Debug)]
pub struct RayBatch {
    /// The body's name.
    pub body: &'static str,
    /// The body.
    pub animation: Arc<Animation>,
    /// The rays.
    pub rays: Vec<Ray>,
}

impl RayBatch {
    /// What the `i`-th ray is aimed at, and whether it begins inside.
    #[must_use]
    pub fn sort(i: usize) -> (Aim, bool) {
        sort_of(i)
    }
}

/// The bodies and rays of a plan, as [`super::run`] asks them.
#[must_use]
pub fn ray_batches(plan: &LeakPlan) -> Vec<RayBatch> {
    let specs = specs(plan, BODIES);
    let ray_batches = specs.iter().map(|spec| {
        let made = spec.make(plan.seed);
        RayBatch {
            body: spec.body.name,
            animation: made.animation,
            rays: made.rays,
        }
    });
    ray_batches.collect()
}
