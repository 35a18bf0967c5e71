//! Kinds of meshes.

use super::moment;
use crate::generate::meshes::{self, PLUMP, separate, soup};
use crate::leaks;
use crate::stress::scenes::{Scene, broken, exploding, moving, still};
use fastrand::Rng;
use geom::Animation;
use std::sync::Arc;

named! {
    /// What a mesh is like. All are about as large as the cube `-1..1`.
    pub(super) enum Kind {
        /// Free triangles.
        Soup = "soup",
        /// Free triangles on their way elsewhere, on an old tree.
        Moving = "moving",
        /// Closed bodies.
        Closed = "closed",
        /// Triangles much longer than wide.
        Needles = "needles",
        /// Triangles of no area and of hardly any, among sound ones.
        Flakes = "flakes",
        /// Equal triangles, turned and reversed, and coplanar ones that overlap.
        Duplicates = "duplicates",
        /// A regular grid in one plane, tilted so that its points stay exact.
        Coplanar = "coplanar",
        /// A sheet with dents over a grid.
        Sheet = "sheet",
        /// Many triangles round one vertex.
        Fan = "fan",
        /// Coordinates that are zeros of either sign, ones and halves.
        Zeros = "zeros",
        /// Some vertices are not finite.
        NonFinite = "non-finite",
        /// A wrung cloth.
        Cloth = "cloth",
        /// Free triangles, one of them far away or far smaller.
        Outlier = "outlier",
        /// A sheet, one vertex of which goes far away.
        Exploding = "exploding",
    }
}

impl Kind {
    /// A scene of this kind without rays.
    pub(super) fn scene(self, cloth: &Arc<Animation>, rng: &mut Rng) -> Scene {
        let free = |n, rng: &mut Rng| soup(n, 0.5, PLUMP, rng);
        match self {
            Self::Soup => {
                let n = rng.usize(1..400);
                still(separate(&free(n, rng)))
            }
            Self::Moving => {
                let keys = vec![free(128, rng).concat(), free(128, rng).concat()];
                moving(keys, 0.0, rng.f64())
            }
            Self::Closed => body(rng),
            Self::Needles => still(separate(&soup(96, 0.8, [-7.0, -3.0], rng))),
            Self::Flakes => still(separate(&meshes::flakes(rng))),
            Self::Duplicates => still(separate(&meshes::stacks(rng))),
            Self::Coplanar => still(meshes::plane(rng)),
            Self::Sheet => {
                let steps = [4, 1000][rng.usize(..2)];
                still(meshes::sheet(16, steps, rng))
            }
            Self::Fan => still(meshes::fan(rng)),
            Self::Zeros => still(separate(&meshes::zeros(48, rng))),
            Self::NonFinite => broken(&free(64, rng), rng),
            Self::Cloth => moment(cloth, rng),
            Self::Outlier => still(separate(&meshes::with_outlier(&free(96, rng), rng))),
            Self::Exploding => exploding(rng),
        }
    }
}

/// One of the bodies that leaks are sought in, turned at random.
fn body(rng: &mut Rng) -> Scene {
    let plan = leaks::LeakPlan {
        seed: rng.u64(..),
        rays: 16,
        offsets: vec![0.0],
        method: backend::Method::default(),
    };
    let mut batches = leaks::ray_batches(&plan);
    let batch = batches.swap_remove(rng.usize(..batches.len()));
    Scene::new(batch.animation, [0.0; 2])
}
