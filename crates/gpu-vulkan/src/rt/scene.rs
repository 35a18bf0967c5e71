//! A scene as the driver's trees need it: its buffers, its box, its tree, and what it does about
//! vertices that are not finite.

use super::Prefer;
use super::tree::DriverTree;
use crate::device::Gpu;
use crate::memory::{Buffer, Place};
use crate::scene::SceneBuffers;
use crate::transfer::{Loader, Transfer};
use backend::Result;
use geom::{Animation, Point};
use std::sync::Arc;

/// Coordinates from here on may overflow when they are blended.
const HUGE: f32 = f32::MAX / 4.0;

/// What the driver must be spared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vertices {
    /// Nothing: all are finite, always.
    Finite,
    /// The same vertices are not finite in every key frame.
    Steady,
    /// Triangles come and go. A tree may not be updated across that.
    Changing,
}

/// A loaded scene.
pub(super) struct RtScene {
    pub(super) buffers: SceneBuffers,
    pub(super) tree: DriverTree,
    /// The box of all key frames, in scaled units, as the two rows of a tree's root.
    pub(super) root: Buffer,
    pub(super) vertices: Vertices,
    /// Positions without what is not finite; `None` where all are finite.
    pub(super) cleansed: Option<Buffer>,
}

impl RtScene {
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        road: &mut Transfer,
        animation: Arc<Animation>,
        prefer: Prefer,
    ) -> Result<Self> {
        let vertices = Vertices::of(animation.keys());
        let bytes = animation.vertex_count() as u64 * 12;
        let cleansed = match vertices {
            Vertices::Finite => None,
            _ => Some(Buffer::new(
                gpu,
                "cleansed positions",
                bytes,
                Place::Device,
            )?),
        };
        let root = Buffer::new(gpu, "the scene's box", 32, Place::Device)?;
        Loader::new(gpu, road, 32)?.send(&root_of(&animation), &root)?;
        let buffers = SceneBuffers::new(gpu, road, animation)?;
        Ok(Self {
            tree: DriverTree::new(gpu, road, &buffers, prefer)?,
            buffers,
            root,
            vertices,
            cleansed,
        })
    }
}

fn root_of(animation: &Animation) -> [f32; 8] {
    let bounds = animation.bounds();
    let scale = (-f64::from(animation.scale_exponent())).exp2();
    let scaled = |p: Point| p.map(|x| (f64::from(x) * scale) as f32);
    let ([a, b, c], [d, e, f]) = (scaled(bounds.min), scaled(bounds.max));
    [a, b, c, 0.0, d, e, f, 0.0]
}

impl Vertices {
    fn of(keys: &[Vec<Point>]) -> Self {
        let tame = |p: &Point| p.iter().all(|x| x.abs() < HUGE);
        let lost = |p: &Point| p.iter().any(|x| !x.is_finite());
        let first = &keys[0];
        let same = |key: &Vec<Point>| {
            let mut pairs = key.iter().zip(first);
            pairs.all(|(p, q)| tame(p) && tame(q) || lost(p) && lost(q))
        };
        if keys.iter().flatten().all(tame) {
            Self::Finite
        } else if keys.iter().all(same) {
            Self::Steady
        } else {
            Self::Changing
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn a_tree_is_updated_only_where_the_same_vertices_are_lost_in_every_key_frame() {
        let key = |x: f32, y: f32| vec![[x, 0.0, 0.0], [0.0, y, 1.0]];
        let of = |keys: &[Vec<Point>]| Vertices::of(keys);
        assert_eq!(of(&[key(1.0, 2.0), key(3.0, 4.0)]), Vertices::Finite);
        let nan = f32::NAN;
        assert_eq!(of(&[key(nan, 2.0), key(nan, 4.0)]), Vertices::Steady);
        assert_eq!(of(&[key(nan, 2.0), key(3.0, 4.0)]), Vertices::Changing);
        assert_eq!(of(&[key(3.0, 2.0), key(3.0, nan)]), Vertices::Changing);
        // Blends of these overflow on the way.
        let big = f32::MAX;
        assert_eq!(of(&[key(big, 2.0), key(-big, 4.0)]), Vertices::Changing);
    }
}
