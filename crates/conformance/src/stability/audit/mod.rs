//! Compares millions of rays with the oracle, on meshes of many kinds, sizes and positions.
//!
//! An [`Audit`] divides its rays among [`BatchSpec`]s. Each is a scene at one moment with rays of every kind. Scene
//! and rays of a batch depend only on the seed and the batch number, so that any batch can be generated alone. An
//! [`AuditBatch`] also holds the oracle's answers, which are computed once and compared with any number of backends.

mod batch;

use crate::generate::cases::placements;
use crate::generate::rays::{Aims, turn};
use crate::generate::scenes::scenes;
use crate::generate::strategies::sample;
use crate::generate::{mixed, shares};
use crate::stability::scenes::StabilityScene;
use crate::stability::stability_test::AnsweredScene;
use fastrand::Rng;
use geom::Animation;
use rayon::prelude::*;
use std::sync::Arc;

pub use crate::generate::scenes::SceneKind;
pub use batch::{AuditBatch, AuditCounts};

/// Maximum number of rays per batch, which is small so that rays are traced in many scenes.
const MOST: u64 = 1 << 14;
/// Minimum number of batches for each kind of mesh.
const BATCHES: u64 = 6;

/// One scene at one moment, and its number of rays.
#[derive(Clone, Copy, Debug)]
pub struct BatchSpec {
    /// Number of the batch within the audit.
    pub number: u64,
    /// Number of rays.
    pub rays: u64,
    /// Kind of its mesh.
    pub kind: SceneKind,
}

/// An audit over meshes of every kind.
#[derive(Clone, Copy, Debug)]
pub struct Audit {
    /// Seed of the meshes and rays.
    pub seed: u64,
    /// Number of rays in all batches.
    pub rays: u64,
}

impl Audit {
    /// Returns all batches that have rays. The numbers of rays for two kinds of mesh differ by at most one.
    pub fn specs(&self) -> Vec<BatchSpec> {
        let kinds = SceneKind::ALL;
        let mut specs = Vec::new();
        for (kind, share) in kinds.into_iter().zip(shares(self.rays, kinds.len() as u64)) {
            for rays in shares(share, share.div_ceil(MOST).max(BATCHES)) {
                let number = specs.len() as u64;
                specs.push(BatchSpec { number, rays, kind });
            }
        }
        specs.retain(|spec| spec.rays > 0);
        specs
    }

    /// Generates a batch's scene and rays, and computes the exact answers, in parallel.
    pub fn batch(&self, spec: &BatchSpec) -> AuditBatch {
        let seed = mixed(mixed(self.seed) ^ spec.number);
        let rng = &mut Rng::with_seed(seed);
        let (place, mesh) = sample(&(placements(), scenes(spec.kind)), seed);
        let animation = place.animation(mesh);
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
fn moment(animation: Arc<Animation>, rng: &mut Rng) -> StabilityScene {
    let time = animation.end() * rng.f64();
    let time = if rng.bool() { time } else { time.round() };
    let built = if rng.bool() { time } else { 0.0 };
    StabilityScene::new(animation, [built, time])
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Intersector;
    use cpu_ref::CpuBackend;

    #[test]
    fn batches_distribute_all_rays_evenly() {
        for rays in [1, 100, 6000, 3_000_000] {
            let audit = Audit { seed: 4, rays };
            let specs = audit.specs();
            let sorts = SceneKind::ALL.len() as u64;
            for source in specs.chunk_by(|a, b| a.kind == b.kind) {
                let sum: u64 = source.iter().map(|spec| spec.rays).sum();
                assert!(sum.abs_diff(rays / sorts) <= 1, "{sum} of {rays}");
            }
            assert_eq!(specs.iter().map(|spec| spec.rays).sum::<u64>(), rays);
            assert!(specs.is_sorted_by(|a, b| a.number < b.number));
        }
    }

    #[test]
    fn batches_are_reproducible_by_seed() {
        let [all, other] = [4, 5].map(|seed| Audit { seed, rays: 20_000 });
        let specs = all.specs();
        for spec in [&specs[3], &specs[specs.len() - 1]] {
            let rays = |audit: &Audit| format!("{:?}", audit.batch(spec));
            assert_eq!(rays(&all), rays(&all));
            assert_ne!(rays(&all), rays(&other));
        }
    }

    #[test]
    fn detects_rounding_intersectors() {
        let audit = Audit {
            seed: 4,
            rays: 5000,
        };
        let mut cpu = CpuBackend::new(Some(2)).unwrap();
        let mut tally = AuditCounts::default();
        for spec in audit.specs() {
            tally += audit
                .batch(&spec)
                .run(&mut cpu, Intersector::Watertight)
                .unwrap();
        }
        assert!(tally.wrong > 100 && tally.wrong_any > 10, "{tally:?}");
        let wrong = &tally.first[0];
        let is_full = wrong.contains("exactly") && wrong.contains("origin");
        assert!(is_full, "{wrong}");
    }
}
