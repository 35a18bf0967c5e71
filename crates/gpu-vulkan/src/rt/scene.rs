//! A scene as the driver's trees need it: its buffers, its box, its tree, and what it does about
//! vertices that are not finite.

use super::Prefer;
use super::tree::DriverTree;
use crate::device::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::scene::SceneBuffers;
use crate::transfer::{Loader, Transfer};
use backend::Result;
use geom::{Animation, Point};
use std::sync::Arc;

/// Coordinates from here on may overflow when they are blended.
const HUGE: f32 = f32::MAX / 4.0;

/// A loaded scene.
pub(super) struct RtScene {
    pub(super) buffers: SceneBuffers,
    pub(super) tree: DriverTree,
    /// The box of all key frames, in scaled units, as the two rows of a tree's root.
    pub(super) root: Buffer,
    /// Three vertices a triangle, all finite; `None` where positions are, always.
    pub(super) cleansed: Option<Buffer>,
    /// Where triangles are drawn together that are not to be hit.
    pub(super) centre: Point,
}

impl RtScene {
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        road: &mut Transfer,
        animation: Arc<Animation>,
        prefer: Prefer,
    ) -> Result<Self> {
        let bytes = animation.triangle_count() as u64 * 36;
        let cleansed = match are_tame(animation.keys()) {
            true => None,
            false => Some(Buffer::new(
                gpu,
                "cleansed triangles",
                bytes,
                BufferUse::Device,
            )?),
        };
        let root = Buffer::new(gpu, "the scene's box", 32, BufferUse::Device)?;
        Loader::new(gpu, road, 32)?.send(&root_of(&animation), &root)?;
        let centre = centre_of(&animation);
        let buffers = SceneBuffers::new(gpu, road, animation)?;
        Ok(Self {
            tree: DriverTree::new(gpu, road, (&buffers, cleansed.as_ref()), prefer)?,
            buffers,
            root,
            cleansed,
            centre,
        })
    }
}

impl RtScene {
    /// Bytes of device memory that the tree takes, and the room to make it, with what it is made from beside positions.
    pub(super) fn tree_held(&self) -> [u64; 2] {
        let cleansed = self.cleansed.as_ref().map_or(0, Buffer::held);
        let [tree, scratch] = self.tree.held();
        [tree + self.root.held(), scratch + cleansed]
    }
}

fn root_of(animation: &Animation) -> [f32; 8] {
    let bounds = animation.bounds();
    let scale = (-f64::from(animation.scale_exponent())).exp2();
    let scaled = |p: Point| p.map(|x| (f64::from(x) * scale) as f32);
    let ([a, b, c], [d, e, f]) = (scaled(bounds.min), scaled(bounds.max));
    [a, b, c, 0.0, d, e, f, 0.0]
}

/// Amid all key frames; the origin if there is nothing.
fn centre_of(animation: &Animation) -> Point {
    let bounds = animation.bounds();
    let middle = |i: usize| f32::midpoint(bounds.min[i], bounds.max[i]);
    let middle = [middle(0), middle(1), middle(2)];
    match middle.iter().all(|x| x.is_finite()) {
        true => middle,
        false => [0.0; 3],
    }
}

/// Whether all vertices are finite and stay so when they are blended.
fn are_tame(keys: &[Vec<Point>]) -> bool {
    let tame = |p: &Point| p.iter().all(|x| x.abs() < HUGE);
    keys.iter().flatten().all(tame)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn triangles_are_cleansed_where_a_vertex_is_or_may_become_infinite_or_no_number() {
        let of = |x: f32| are_tame(&[vec![[1.0; 3]], vec![[0.0, x, 1.0]]]);
        assert!(of(2.0) && of(-1e30));
        for bad in [f32::NAN, f32::INFINITY, f32::MIN] {
            assert!(!of(bad), "{bad}");
        }
    }
}
