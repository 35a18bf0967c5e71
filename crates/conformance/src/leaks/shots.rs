//! The same bodies and rays, for those who judge by something else than parity alone.

use super::Plan;
use super::aim::{Aim, sort_of};
use super::bodies::BODIES;
use super::lots::lots;
use geom::{Animation, Ray};
use std::sync::Arc;

/// A closed body that stands still, and rays at it.
#[derive(Clone, Debug)]
pub struct Shots {
    /// The body's name.
    pub body: &'static str,
    /// The body.
    pub animation: Arc<Animation>,
    /// The rays.
    pub rays: Vec<Ray>,
}

impl Shots {
    /// What the `i`-th ray is aimed at, and whether it begins inside.
    #[must_use]
    pub fn sort(i: usize) -> (Aim, bool) {
        sort_of(i)
    }
}

/// The bodies and rays of a plan, as [`super::run`] asks them.
#[must_use]
pub fn shots(plan: &Plan) -> Vec<Shots> {
    let lots = lots(plan, BODIES);
    let shots = lots.iter().map(|lot| {
        let made = lot.make(plan.seed);
        Shots {
            body: lot.body.name,
            animation: made.animation,
            rays: made.rays,
        }
    });
    shots.collect()
}
