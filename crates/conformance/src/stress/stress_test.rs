//! Scenes of one family with their exact answers, and what a backend makes of them.

use crate::compare::same_hit;
use crate::leaks::crossings;
use crate::oracle::{ExactHit, Oracle};
use crate::stage::{ask, moment, open, stand};
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
    /// Each with how many closed triangles each ray meets, if it is of a closed body.
    scenes: Vec<(Answered, Vec<u32>)>,
}

/// A scene with what its rays hit.
#[derive(Clone, Debug)]
pub(super) struct Answered {
    pub(super) scene: Scene,
    pub(super) exact: Vec<Option<ExactHit>>,
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
        let answered = |scene| {
            let (answered, oracle) = Answered::new(scene);
            let rays = answered.scene.rays.par_iter();
            let all = rays.filter(|_| answered.scene.inside.is_some());
            let crossings = all.map(|r| oracle.all(r).len() as u32).collect();
            (answered, crossings)
        };
        let scenes = scenes(family, plan).into_par_iter();
        Self {
            family,
            scenes: scenes.map(answered).collect(),
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
        for scene in &self.scenes {
            match self.ask_one(subject, method, scene) {
                Err(BackendError::Unsupported { .. }) => return Ok(None),
                tally => sum += tally?,
            }
        }
        if let Some(r) = &mut sum.rearranged {
            r.sah_ratio = r.sah_ratio.map(|sum| sum / self.scenes.len() as f64);
        }
        Ok(Some(sum))
    }

    fn ask_one(
        &self,
        subject: &mut dyn Backend,
        method: Method,
        (answered, crossings): &(Answered, Vec<u32>),
    ) -> Result<StressCounts> {
        let scene = &answered.scene;
        let (hits, report) = scene.trace(subject, method, scene.built)?;
        let found = hits.closest;
        let closed = match &scene.inside {
            Some(inside) => Some(closed(subject, method, scene, (inside, crossings, &found))?),
            None => None,
        };
        let rearranged = match self.family {
            Family::Rearranged => {
                Some(rearranged(subject, method, scene, &found, report.sah_cost)?)
            }
            _ => None,
        };
        let differs = |i: &usize| found[*i].triangle != answered.triangle(*i);
        Ok(StressCounts {
            rays: found.len() as u64,
            wrong: (0..found.len()).filter(differs).count() as u64,
            closed,
            rearranged,
        })
    }
}

impl Answered {
    /// Asks the oracle, on as many threads as there are.
    pub(super) fn new(scene: Scene) -> (Self, Oracle) {
        let oracle = Oracle::at(&moment(&scene.animation, scene.time));
        let exact = scene.rays.par_iter().map(|r| oracle.closest(r)).collect();
        (Self { scene, exact }, oracle)
    }

    /// What a ray hits, or the triangle of [`Hit::MISS`].
    pub(super) fn triangle(&self, ray: usize) -> u32 {
        self.exact[ray].map_or(Hit::MISS.triangle, |e| e.triangle)
    }
}

fn closed(
    subject: &mut dyn Backend,
    method: Method,
    scene: &Scene,
    (inside, exact, found): (&[bool], &[u32], &[Hit]),
) -> Result<Closed> {
    let counts = crossings(subject, method, &scene.animation, &scene.rays)?;
    let double = |i: &usize| match method.intersector {
        Intersector::Exact => counts[*i] != exact[*i],
        _ => (counts[*i] % 2 == 1) != inside[*i],
    };
    let leaks = |(inside, hit): &(&bool, &Hit)| **inside && !hit.is_hit();
    Ok(Closed {
        inside: inside.iter().filter(|&&i| i).count() as u64,
        leaks: inside.iter().zip(found).filter(leaks).count() as u64,
        counted: counts.len() as u64,
        doubles: (0..counts.len()).filter(double).count() as u64,
    })
}

/// Asks again on a tree built anew.
fn rearranged(
    subject: &mut dyn Backend,
    method: Method,
    scene: &Scene,
    found: &[Hit],
    refitted: Option<f64>,
) -> Result<Rearranged> {
    let (hits, report) = scene.trace(subject, method, scene.time)?;
    let pairs = found.iter().zip(&hits.closest);
    Ok(Rearranged {
        dependent: pairs.filter(|(a, b)| !same_hit(a, b)).count() as u64,
        sah_ratio: refitted.zip(report.sah_cost).map(|(old, new)| old / new),
    })
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
