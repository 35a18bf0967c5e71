//! Scenes of one family with their exact answers, and what a backend makes of them.

use crate::compare::same_hit;
use crate::leaks::crossings;
use crate::oracle::Oracle;
use crate::stage::{ask, open, stand};
use crate::stress::scenes::{Scene, scenes};
use crate::stress::{Family, Plan};
use backend::{
    Backend, BackendError, FrameReport, Hits, Intersector, Method, QueryKind, Rays, Result,
};
use geom::Hit;
use rayon::prelude::*;
use std::ops::AddAssign;

/// A family's scenes and rays, answered exactly.
#[derive(Clone, Debug)]
pub struct StressTest {
    family: Family,
    scenes: Vec<Answered>,
}

/// A scene with what its rays hit.
#[derive(Clone, Debug)]
struct Answered {
    scene: Scene,
    /// The triangle, or that of [`Hit::MISS`].
    hits: Vec<u32>,
    /// Of a closed body: how many closed triangles each ray meets.
    crossings: Vec<u32>,
}

/// What was counted in one family.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StressCounts {
    /// Rays asked.
    pub rays: u64,
    /// Those whose hit or miss or whose triangle is not the exact answer's.
    pub wrong: u64,
    /// Of closed bodies alone.
    pub closed: Option<Closed>,
    /// Of rearranged scenes alone.
    pub rearranged: Option<Rearranged>,
}

/// What was counted of closed bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Closed {
    /// Rays from inside.
    pub inside: u64,
    /// Those that met nothing.
    pub leaks: u64,
    /// Rays whose crossings were counted.
    pub counted: u64,
    /// Those that cross an even number of times from inside, or an odd one from outside. Of `exact`, whose
    /// triangles are closed and so share their edges: those that meet another number of triangles than exactly.
    pub doubles: u64,
}

/// What became of a tree whose triangles all went elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rearranged {
    /// Rays that hit otherwise, in any bit, than with a tree built anew.
    pub dependent: u64,
    /// Cost of the refitted tree over that of one built anew, by the surface area heuristic, on the mean over scenes
    /// of equal weight; `None` where the backend does not measure it.
    pub sah_ratio: Option<f64>,
}

impl StressTest {
    /// Makes and answers the rays of a family.
    #[must_use]
    pub fn new(family: Family, plan: &Plan) -> Self {
        let scenes = scenes(family, plan).into_par_iter();
        Self {
            family,
            scenes: scenes.map(Answered::new).collect(),
        }
    }

    /// The family.
    #[must_use]
    pub fn family(&self) -> Family {
        self.family
    }

    /// Asks a backend everything; `None` if it does not support the intersector.
    ///
    /// # Errors
    /// The subject failed.
    pub fn ask(
        &self,
        subject: &mut dyn Backend,
        intersector: Intersector,
    ) -> Result<Option<StressCounts>> {
        let method = Method {
            intersector,
            ..Method::default()
        };
        let mut sum = StressCounts::default();
        for answered in &self.scenes {
            match answered.ask(subject, method, self.family) {
                Err(BackendError::Unsupported { .. }) => return Ok(None),
                tally => sum += tally?,
            }
        }
        if let Some(r) = &mut sum.rearranged {
            r.sah_ratio = r.sah_ratio.map(|sum| sum / self.scenes.len() as f64);
        }
        Ok(Some(sum))
    }
}

impl Answered {
    fn new(scene: Scene) -> Self {
        let oracle = Oracle::at(&scene.animation, scene.animation.pose(scene.time));
        let closest = |r| oracle.closest(r).map_or(Hit::MISS.triangle, |h| h.triangle);
        let hits = scene.rays.par_iter().map(closest).collect();
        let crossings = match scene.inside {
            Some(_) => {
                let all = scene.rays.par_iter().map(|r| oracle.all(r).len() as u32);
                all.collect()
            }
            None => Vec::new(),
        };
        Self {
            scene,
            hits,
            crossings,
        }
    }

    fn ask(
        &self,
        subject: &mut dyn Backend,
        method: Method,
        family: Family,
    ) -> Result<StressCounts> {
        let scene = &self.scene;
        let (hits, report) = scene.trace(subject, method, scene.built)?;
        let found = hits.closest;
        let differs = |(hit, exact): &(&Hit, &u32)| hit.triangle != **exact;
        let closed = match &scene.inside {
            Some(inside) => Some(self.closed(subject, method, inside, &found)?),
            None => None,
        };
        let rearranged = if family == Family::Rearranged {
            Some(self.rearranged(subject, method, &found, report.sah_cost)?)
        } else {
            None
        };
        Ok(StressCounts {
            rays: found.len() as u64,
            wrong: found.iter().zip(&self.hits).filter(differs).count() as u64,
            closed,
            rearranged,
        })
    }

    fn closed(
        &self,
        subject: &mut dyn Backend,
        method: Method,
        inside: &[bool],
        found: &[Hit],
    ) -> Result<Closed> {
        let (body, rays) = (&self.scene.animation, &self.scene.rays);
        let counts = crossings(subject, method, body, rays)?;
        let double = |i: &usize| match method.intersector {
            Intersector::Exact => counts[*i] != self.crossings[*i],
            _ => (counts[*i] % 2 == 1) != inside[*i],
        };
        let leaks = |(inside, hit): &(&bool, &Hit)| **inside && !hit.is_hit();
        Ok(Closed {
            inside: inside.iter().filter(|&&i| i).count() as u64,
            leaks: inside.iter().zip(found).filter(leaks).count() as u64,
            counted: rays.len() as u64,
            doubles: (0..rays.len()).filter(double).count() as u64,
        })
    }

    /// Asks again on a tree built anew.
    fn rearranged(
        &self,
        subject: &mut dyn Backend,
        method: Method,
        found: &[Hit],
        refitted: Option<f64>,
    ) -> Result<Rearranged> {
        let (hits, report) = self.scene.trace(subject, method, self.scene.time)?;
        let pairs = found.iter().zip(&hits.closest);
        Ok(Rearranged {
            dependent: pairs.filter(|(a, b)| !same_hit(a, b)).count() as u64,
            sah_ratio: refitted.zip(report.sah_cost).map(|(old, new)| old / new),
        })
    }
}

impl Scene {
    /// What the scene's rays hit first with a tree built at `built`.
    pub(super) fn trace(
        &self,
        subject: &mut dyn Backend,
        method: Method,
        built: f64,
    ) -> Result<(Hits, FrameReport)> {
        open(subject, &self.animation, built, method)?;
        stand(subject, &self.animation, self.time)?;
        ask(subject, Rays::List(&self.rays), QueryKind::Closest)
    }
}

impl AddAssign for StressCounts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.wrong += other.wrong;
        if let Some(c) = other.closed {
            let sum = self.closed.get_or_insert_default();
            sum.inside += c.inside;
            sum.leaks += c.leaks;
            sum.counted += c.counted;
            sum.doubles += c.doubles;
        }
        if let Some(r) = other.rearranged {
            let none = Rearranged {
                dependent: 0,
                sah_ratio: Some(0.0),
            };
            let sum = self.rearranged.get_or_insert(none);
            sum.dependent += r.dependent;
            sum.sah_ratio = sum.sah_ratio.zip(r.sah_ratio).map(|(a, b)| a + b);
        }
    }
}
