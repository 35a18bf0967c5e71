//! Rays by the million against the oracle: every one of them, on meshes of many kinds and places.
//!
//! An [`Audit`] shares its rays out among [`BatchSpec`]s, each a scene at one moment with rays of every sort. Scene and
//! rays of a batch depend on the seed and its number alone, so that any can be made again without the others. A
//! [`Batch`] also holds the oracle's answers, found once and held against any number of backends.

mod aim;
mod batch;
mod bounds;
mod kind;
mod place;
#[cfg(test)]
mod tests;

use crate::stress::scenes::Scene;
use aim::rays;
use fastrand::Rng;
use geom::Animation;
use kind::Kind;
use place::Placement;
use std::sync::Arc;

pub use batch::{AuditCounts, Batch, Wrong};

/// Rays of a scene made here: few, so that many rays see many scenes.
const MOST: u64 = 1 << 14;
/// Rays of a scene that was given, whose trees take longer.
const MOST_GIVEN: u64 = 1 << 18;
/// A given scene is asked at so many moments at least.
const MOMENTS: u64 = 3;
/// Triangles of the cloth.
const CLOTH: &str = "demo:twist:1500";

/// What to ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AuditPlan {
    /// Decides scenes and rays.
    pub seed: u64,
    /// Rays in all.
    pub rays: u64,
}

/// A scene that somebody gave.
#[derive(Clone, Debug)]
pub struct Given {
    /// Its name.
    pub name: String,
    /// What rays hit.
    pub animation: Arc<Animation>,
}

/// Where a batch's scene comes from.
#[derive(Clone, Copy, Debug)]
enum Source {
    Made(Kind, Placement),
    /// By its place among those given.
    Given(usize),
}

/// One scene at one moment, and how many rays it is asked.
#[derive(Clone, Copy, Debug)]
pub struct BatchSpec {
    /// Its number among all batches of the audit.
    pub number: u64,
    /// Rays it is asked.
    pub rays: u64,
    source: Source,
}

/// A plan with all that its scenes are made from.
#[derive(Debug)]
pub struct Audit {
    plan: AuditPlan,
    given: Vec<Given>,
    cloth: Arc<Animation>,
}

impl Audit {
    /// An audit over meshes of every kind made from the plan's seed, and over the scenes given.
    ///
    /// # Panics
    /// Never: the one demo it opens needs no file.
    #[must_use]
    pub fn new(plan: AuditPlan, given: Vec<Given>) -> Self {
        let cloth = scene::open(CLOTH, &scene::Options::default());
        Self {
            plan,
            given,
            cloth: cloth.expect("demos need no file").animation,
        }
    }

    /// All batches that have rays. Each kind of mesh gets as many rays as the next, and as many as each scene given.
    #[must_use]
    pub fn specs(&self) -> Vec<BatchSpec> {
        let sorts = Kind::ALL.len() + self.given.len();
        let [made, given] = [Kind::ALL.len(), 1].map(|n| self.plan.rays * n as u64 / sorts as u64);
        let mut specs = Vec::new();
        let made = made + self.plan.rays - made - given * self.given.len() as u64;
        let combinations = (Kind::ALL.len() * Placement::ALL.len()) as u64;
        self.share(made, [combinations, MOST], &mut specs, |i| {
            let (kind, place) = (i % Kind::ALL.len(), i / Kind::ALL.len());
            Source::Made(
                Kind::ALL[kind],
                Placement::ALL[place % Placement::ALL.len()],
            )
        });
        for i in 0..self.given.len() {
            self.share(given, [MOMENTS, MOST_GIVEN], &mut specs, |_| {
                Source::Given(i)
            });
        }
        specs.retain(|spec| spec.rays > 0);
        specs
    }

    /// Shares rays out among so many batches at least, of so many rays at most.
    fn share(
        &self,
        rays: u64,
        [least, most]: [u64; 2],
        specs: &mut Vec<BatchSpec>,
        source: impl Fn(usize) -> Source,
    ) {
        let count = rays.div_ceil(most).max(least);
        let first = specs.len() as u64;
        specs.extend((0..count).map(|i| BatchSpec {
            number: first + i,
            rays: rays / count + u64::from(i < rays % count),
            source: source(i as usize),
        }));
    }

    /// What a batch's scene is called: the kind of mesh or the name given.
    #[must_use]
    pub fn name(&self, spec: &BatchSpec) -> &str {
        match spec.source {
            Source::Made(kind, _) => kind.name(),
            Source::Given(i) => &self.given[i].name,
        }
    }

    /// What a batch is made of, for messages.
    #[must_use]
    pub fn about(&self, spec: &BatchSpec) -> String {
        match spec.source {
            Source::Made(kind, place) => format!("{}, {}", kind.name(), place.name()),
            Source::Given(i) => self.given[i].name.clone(),
        }
    }

    /// Makes a batch's scene and rays, and finds the exact answers, on as many threads as there are.
    #[must_use]
    pub fn batch(&self, spec: &BatchSpec) -> Batch {
        let seed = mixed(mixed(self.plan.seed) ^ spec.number);
        let rng = &mut Rng::with_seed(seed);
        let mut scene = match spec.source {
            Source::Made(kind, place) => place.put(kind.scene(&self.cloth, rng), rng),
            Source::Given(i) => moment(&self.given[i].animation, rng),
        };
        scene.rays = rays(&scene, spec.rays, seed);
        Batch::new(*spec, scene)
    }
}

/// A scene at a key frame or between two, on a tree of its beginning or of the moment.
fn moment(animation: &Arc<Animation>, rng: &mut Rng) -> Scene {
    let time = animation.end() * rng.f64();
    let time = if rng.bool() { time } else { time.round() };
    Scene {
        built: if rng.bool() { time } else { 0.0 },
        time,
        animation: Arc::clone(animation),
        rays: Vec::new(),
        inside: None,
    }
}

/// A number at random that depends on `x` alone.
fn mixed(x: u64) -> u64 {
    Rng::with_seed(x).u64(..)
}
