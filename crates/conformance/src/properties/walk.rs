//! Rays that continue from the last reported distance.

use super::Check;
use crate::compare::{ray_text, same_hit, triangle_text};
use crate::oracle::{ExactHit, Oracle};
use crate::stage::triangles;
use anyhow::{Result, ensure};
use backend::{QueryKind, Rays};
use geom::{Hit, Ray};

/// A ray that continues from its hits, and every crossing of its line within the original interval.
struct CrossingWalk {
    ray: Ray,
    crossings: Vec<ExactHit>,
}

impl CrossingWalk {
    /// Returns the next hit. Crossings whose rounded `t` equals the last one are skipped.
    fn expected(&self) -> Hit {
        let mut ahead = self.crossings.iter();
        let next = ahead.find(|crossing| crossing.rounded[0] > self.ray.t_min);
        next.map_or(Hit::MISS, |crossing| {
            let ([t, u, v], triangle) = (crossing.rounded, crossing.triangle);
            Hit { t, u, v, triangle }
        })
    }
}

/// Tests that a ray that continues with `t_min` equal to the last reported `t` visits the exact crossings in order.
///
/// It hits no triangle twice, and ends.
pub(super) fn visits_every_crossing_once(c: &mut Check<'_>) -> Result<()> {
    let (animation, time) = (&c.case.animation, c.case.times[1]);
    let oracle = Oracle::new(triangles(animation, time));
    let start = |&ray: &Ray| CrossingWalk {
        crossings: oracle.all(&ray),
        ray,
    };
    let mut walks: Vec<CrossingWalk> = c.case.rays.iter().map(start).collect();
    c.open(c.case.times[0])?;
    c.interpolate_and_refit(time)?;
    while !walks.is_empty() {
        let rays: Vec<Ray> = walks.iter().map(|walk| walk.ray).collect();
        let closest = c
            .trace_and_wait(Rays::List(&rays), QueryKind::Closest)?
            .closest;
        let any = c.trace_and_wait(Rays::List(&rays), QueryKind::Any)?.blocked;
        for ((walk, hit), any) in walks.iter_mut().zip(&closest).zip(&any) {
            let expected = walk.expected();
            ensure!(
                same_hit(hit, &expected) && (*any == 1) == expected.is_hit(),
                "at time {time:?}: hit {hit:?} (any: {any}), expected {expected:?}; {}; {} against {}",
                ray_text(&walk.ray),
                triangle_text(animation, time, hit.triangle),
                triangle_text(animation, time, expected.triangle),
            );
            walk.ray.t_min = hit.t;
        }
        walks.retain(|walk| walk.ray.t_min < f32::INFINITY);
    }
    Ok(())
}
