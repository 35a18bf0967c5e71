//! Rays by the million against the oracle: every one of them, on meshes of many kinds and places.
//!
//! An [`Audit`] shares its rays out among [`BatchSpec`]s, each a scene at one moment with rays of every sort. Scene and
//! rays of a batch depend on the seed and its number alone, so that any can be made again without the others. A
//! [`Batch`] also holds the oracle's answers, found once and held against any number of backends.

mod batch;
mod bounds;
mod kind;
#[cfg(test)]
mod tests;

use crate::generate::placement::{PLACES, Placement};
use crate::generate::rays::{Aims, RayKind, Target, void};
use crate::generate::{mixed, shares};
use crate::stress::scenes::Scene;
use fastrand::Rng;
use geom::{Animation, Point, Ray};
use kind::Kind;
use rayon::prelude::*;
use std::sync::Arc;

pub use batch::{AuditCounts, Batch};

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
    /// A kind of mesh, and one of [`PLACES`].
    Made(Kind, usize),
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
        let combinations = (Kind::ALL.len() * PLACES.len()) as u64;
        self.share(made, [combinations, MOST], &mut specs, |i| {
            let (kind, place) = (i % Kind::ALL.len(), i / Kind::ALL.len());
            Source::Made(Kind::ALL[kind], place % PLACES.len())
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
        specs.extend(shares(rays, count).zip(0..).map(|(rays, i)| BatchSpec {
            number: first + i,
            rays,
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
            Source::Made(kind, place) => format!("{kind}, {}", PLACES[place].0),
            Source::Given(i) => self.given[i].name.clone(),
        }
    }

    /// Makes a batch's scene and rays, and finds the exact answers, on as many threads as there are.
    #[must_use]
    pub fn batch(&self, spec: &BatchSpec) -> Batch {
        let seed = mixed(mixed(self.plan.seed) ^ spec.number);
        let rng = &mut Rng::with_seed(seed);
        let mut scene = match spec.source {
            Source::Made(kind, place) => {
                let scene = kind.scene(&self.cloth, rng);
                put(scene, (PLACES[place].1)(rng))
            }
            Source::Given(i) => moment(&self.given[i].animation, rng),
        };
        scene.rays = rays(&scene, spec.rays, seed);
        Batch::new(*spec, scene)
    }
}

/// Puts the scene elsewhere.
fn put(scene: Scene, place: Placement) -> Scene {
    let keys = scene.animation.all_keys().expect("they are held");
    let keys = keys
        .iter()
        .map(|key| key.iter().map(|&p| place.put(p)).collect());
    let keys: Vec<Vec<Point>> = keys.collect();
    let animation = Animation::new(keys, scene.animation.triangles().to_vec());
    Scene {
        animation: Arc::new(animation.expect("the mesh is the same")),
        ..scene
    }
}

/// A scene at a key frame or between two, on a tree of its beginning or of the moment.
fn moment(animation: &Arc<Animation>, rng: &mut Rng) -> Scene {
    let time = animation.end() * rng.f64();
    let time = if rng.bool() { time } else { time.round() };
    let built = if rng.bool() { time } else { 0.0 };
    Scene::new(Arc::clone(animation), [built, time])
}

/// Rays take turns: of which kind each is, and at what it aims if that is not left to chance.
const SORTS: [(RayKind, Option<Target>); 16] = [
    (RayKind::Random, None),
    (RayKind::Aimed, Some(Target::Inside)),
    (RayKind::Aimed, Some(Target::Edge)),
    (RayKind::Aimed, Some(Target::Edge)),
    (RayKind::Aimed, Some(Target::Vertex)),
    (RayKind::Aimed, Some(Target::Vertex)),
    (RayKind::Exactly, Some(Target::Edge)),
    (RayKind::Exactly, Some(Target::Vertex)),
    (RayKind::InPlane, None),
    (RayKind::InPlaneExactly, None),
    (RayKind::AlongAxis, None),
    (RayKind::OnSurface, None),
    (RayKind::Between, None),
    (RayKind::Beyond, None),
    (RayKind::Limited, None),
    (RayKind::AlongEdge, None),
];
/// Triangles of which each may be asked by a single ray.
const FEW: usize = 4096;

/// The first `count` rays of a scene; each depends on the scene, the seed and its number alone.
fn rays(scene: &Scene, count: u64, seed: u64) -> Vec<Ray> {
    let [near, aims] = &Aims::of(&scene.animation, scene.time);
    let one = |i: u64| {
        let rng = &mut Rng::with_seed(mixed(seed ^ (i + 1)));
        ray([near, aims][rng.usize(..4).min(1)], i, rng)
    };
    (0..count).into_par_iter().map(one).collect()
}

fn ray(aims: &Aims, i: u64, rng: &mut Rng) -> Ray {
    let round = i / SORTS.len() as u64;
    let (kind, target) = SORTS[(i % SORTS.len() as u64) as usize];
    let target = target.unwrap_or_else(|| Target::ALL[rng.usize(..3)]);
    // Hardly ever so far that only integers decide what is hit, of every triangle.
    let farthest = kind == RayKind::Beyond && round % 64 == 31;
    let made = match farthest && (1..=FEW).contains(&aims.count()) {
        true => aims.beyond(target, 2.0_f64.powi(rng.i32(70..90)), rng),
        false => aims.ray(kind, target, rng),
    };
    // Now and then much longer or shorter, and now and then no ray at all.
    match round % 32 {
        7 | 15 => {
            let by = 2.0_f32.powi(rng.i32(-80..80));
            let direction: Point = made.direction.map(|x| x * by);
            Ray { direction, ..made }
        }
        23 if i.is_multiple_of(4) => void(made, rng),
        _ => made,
    }
}
