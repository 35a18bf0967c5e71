//! Compares millions of rays with the oracle, on meshes of many kinds, sizes and positions.
//!
//! An [`Audit`] divides its rays among [`BatchSpec`]s. Each is a scene at one moment with rays of every kind. Scene and
//! rays of a batch depend only on the seed and the batch number, so that any batch can be generated alone. A [`AuditBatch`]
//! also holds the oracle's answers, which are computed once and compared with any number of backends.

mod batch;

use crate::generate::cases::placements;
use crate::generate::rays::{Aims, turn};
use crate::generate::scenes::{SceneKind, scenes};
use crate::generate::strategies::sample;
use crate::generate::{mixed, shares};
use crate::stress::scenes::StressScene;
use crate::stress::stress_test::AnsweredScene;
use fastrand::Rng;
use geom::Animation;
use rayon::prelude::*;
use std::sync::Arc;

pub use batch::{AuditBatch, AuditCounts};

/// Maximum number of rays per batch, which is small so that rays are traced in many scenes.
const MOST: u64 = 1 << 14;
/// Minimum number of batches for each kind of mesh and each given scene.
const BATCHES: u64 = 6;

/// One scene at one moment, and its number of rays.
#[derive(Clone, Copy, Debug)]
pub struct BatchSpec {
    /// Number of the batch within the audit.
    pub number: u64,
    /// Number of rays.
    pub rays: u64,
    /// Index of a kind of mesh or, after those, of a given scene.
    source: usize,
}

/// An audit with a seed, a number of rays and given scenes.
#[derive(Debug)]
pub struct Audit {
    seed: u64,
    rays: u64,
    given: Vec<(String, Arc<Animation>)>,
}

impl Audit {
    /// Creates an audit of `rays` rays, over meshes of every kind generated from `seed` and over the `given` named
    /// scenes.
    pub fn new(seed: u64, rays: u64, given: Vec<(String, Arc<Animation>)>) -> Self {
        Self { seed, rays, given }
    }

    /// Returns all batches that have rays. Each kind of mesh and each given scene gets the same number of rays, up to
    /// one.
    pub fn specs(&self) -> Vec<BatchSpec> {
        let sources = SceneKind::ALL.len() + self.given.len();
        let mut specs = Vec::new();
        for (source, share) in shares(self.rays, sources as u64).enumerate() {
            for rays in shares(share, share.div_ceil(MOST).max(BATCHES)) {
                let number = specs.len() as u64;
                specs.push(BatchSpec {
                    number,
                    rays,
                    source,
                });
            }
        }
        specs.retain(|spec| spec.rays > 0);
        specs
    }

    /// Returns the name of a batch's scene: the kind of mesh or the given name.
    pub fn name(&self, spec: &BatchSpec) -> &str {
        match SceneKind::ALL.get(spec.source) {
            Some(kind) => kind.name(),
            None => &self.given[spec.source - SceneKind::ALL.len()].0,
        }
    }

    /// Generates a batch's scene and rays, and computes the exact answers, in parallel.
    pub fn batch(&self, spec: &BatchSpec) -> AuditBatch {
        let seed = mixed(mixed(self.seed) ^ spec.number);
        let rng = &mut Rng::with_seed(seed);
        let animation = match SceneKind::ALL.get(spec.source) {
            Some(&kind) => {
                let (place, scene) = sample(&(placements(), scenes(kind)), seed);
                place.animation(scene)
            }
            None => Arc::clone(&self.given[spec.source - SceneKind::ALL.len()].1),
        };
        let mut scene = moment(animation, rng);
        let aims = Aims::of(&scene.animation, scene.time);
        let ray = |i| Aims::pick(&aims, &sample(&turn(i), mixed(seed ^ (i + 1))));
        scene.rays = (0..spec.rays).into_par_iter().map(ray).collect();
        AuditBatch {
            spec: *spec,
            answered: AnsweredScene::new(scene),
        }
    }
}

/// Returns a scene at a key frame or between two, with a tree built at the start or at this moment.
fn moment(animation: Arc<Animation>, rng: &mut Rng) -> StressScene {
    let time = animation.end() * rng.f64();
    let time = if rng.bool() { time } else { time.round() };
    let built = if rng.bool() { time } else { 0.0 };
    StressScene::new(animation, [built, time])
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Intersector;
    use cpu_ref::CpuBackend;

    fn given() -> Vec<(String, Arc<Animation>)> {
        let scene = scene::open("demo:collide:300", &scene::Options::default());
        vec![("bodies".to_owned(), scene.unwrap().animation)]
    }

    #[test]
    fn batches_distribute_all_rays_evenly() {
        for rays in [1, 100, 6000, 3_000_000] {
            let audit = Audit::new(4, rays, given());
            let specs = audit.specs();
            let sorts = SceneKind::ALL.len() as u64 + 1;
            for source in specs.chunk_by(|a, b| audit.name(a) == audit.name(b)) {
                let sum: u64 = source.iter().map(|spec| spec.rays).sum();
                assert!(sum.abs_diff(rays / sorts) <= 1, "{sum} of {rays}");
            }
            assert_eq!(specs.iter().map(|spec| spec.rays).sum::<u64>(), rays);
            assert!(specs.is_sorted_by(|a, b| a.number < b.number));
        }
    }

    #[test]
    fn batches_are_reproducible_by_seed() {
        let [all, other] = [4, 5].map(|seed| Audit::new(seed, 20_000, given()));
        let specs = all.specs();
        for spec in [&specs[3], &specs[specs.len() - 1]] {
            let rays = |audit: &Audit| format!("{:?}", audit.batch(spec));
            assert_eq!(rays(&all), rays(&all));
            assert_ne!(rays(&all), rays(&other));
        }
    }

    #[test]
    fn detects_rounding_intersectors() {
        let audit = Audit::new(4, 5000, Vec::new());
        let mut cpu = CpuBackend::new(Some(2)).unwrap();
        let mut tally = AuditCounts::default();
        for spec in audit.specs() {
            tally += audit
                .batch(&spec)
                .ask(&mut cpu, Intersector::Watertight)
                .unwrap();
        }
        assert!(tally.wrong > 100 && tally.wrong_any > 10, "{tally:?}");
        let wrong = &tally.first[0];
        let is_full = wrong.contains("exactly") && wrong.contains("origin");
        assert!(is_full, "{wrong}");
    }
}
