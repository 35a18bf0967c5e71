//! Kinds of meshes.

use super::moment;
use crate::leaks;
use crate::stress::meshes::{self, PLUMP, separate, soup};
use crate::stress::scenes::{Scene, broken, exploding, moving, still};
use fastrand::Rng;
use geom::Animation;
use std::sync::Arc;

/// What a mesh is like. All are about as large as the cube `-1..1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Free triangles.
    Soup,
    /// Free triangles on their way elsewhere, on an old tree.
    Moving,
    /// Closed bodies.
    Closed,
    /// Triangles much longer than wide.
    Needles,
    /// Triangles of no area and of hardly any, among sound ones.
    Flakes,
    /// Equal triangles, turned and reversed, and coplanar ones that overlap.
    Duplicates,
    /// A regular grid in one plane, tilted so that its points stay exact.
    Coplanar,
    /// A sheet with dents over a grid.
    Sheet,
    /// Many triangles round one vertex.
    Fan,
    /// Coordinates that are zeros of either sign, ones and halves.
    Zeros,
    /// Some vertices are not finite.
    NonFinite,
    /// A wrung cloth.
    Cloth,
    /// Free triangles, one of them far away or far smaller.
    Outlier,
    /// A sheet, one vertex of which goes far away.
    Exploding,
}

impl Kind {
    pub(super) const ALL: [Self; 14] = [
        Self::Soup,
        Self::Moving,
        Self::Closed,
        Self::Needles,
        Self::Flakes,
        Self::Duplicates,
        Self::Coplanar,
        Self::Sheet,
        Self::Fan,
        Self::Zeros,
        Self::NonFinite,
        Self::Cloth,
        Self::Outlier,
        Self::Exploding,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Soup => "soup",
            Self::Moving => "moving",
            Self::Closed => "closed",
            Self::Needles => "needles",
            Self::Flakes => "flakes",
            Self::Duplicates => "duplicates",
            Self::Coplanar => "coplanar",
            Self::Sheet => "sheet",
            Self::Fan => "fan",
            Self::Zeros => "zeros",
            Self::NonFinite => "non-finite",
            Self::Cloth => "cloth",
            Self::Outlier => "outlier",
            Self::Exploding => "exploding",
        }
    }

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
                still(meshes::sheet(steps, rng))
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
    let mut ray_batches = leaks::ray_batches(&plan);
    let shot = ray_batches.swap_remove(rng.usize(..ray_batches.len()));
    Scene {
        built: 0.0,
        time: 0.0,
        animation: shot.animation,
        rays: Vec::new(),
        inside: None,
    }
}
