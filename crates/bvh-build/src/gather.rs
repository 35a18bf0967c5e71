//! Reads the builder's boxes, drops unusable boxes, and scales the others to a safe range.

use crate::bins::CHUNK;
use crate::prim::{Prim, PrimBounds, PrimExtents};
use geom::{Aabb, Animation, Point};
use rayon::prelude::*;

/// One box per triangle. A triangle whose box is empty or not finite is not in the tree.
pub trait Boxes: Sync {
    /// Returns the number of triangles, including those that are not in the tree.
    fn triangle_count(&self) -> usize;

    /// Returns the box of one triangle.
    fn get(&self, triangle: u32) -> Aabb;
}

impl Boxes for [Aabb] {
    fn triangle_count(&self) -> usize {
        self.len()
    }

    #[inline]
    fn get(&self, triangle: u32) -> Aabb {
        self[triangle as usize]
    }
}

/// The boxes over which a tree of an animation is built, with the given vertices. A triangle that is inactive at these
/// vertices has its [`Animation::fallback_box`], so a tree contains all live triangles.
#[derive(Clone, Copy, Debug)]
pub struct AnimationBoxes<'a> {
    /// The animation.
    pub animation: &'a Animation,
    /// Positions of its vertices.
    pub vertices: &'a [Point],
}

impl Boxes for AnimationBoxes<'_> {
    fn triangle_count(&self) -> usize {
        self.animation.triangle_count()
    }

    #[inline]
    fn get(&self, triangle: u32) -> Aabb {
        self.animation.build_box(self.vertices, triangle)
    }
}

/// Returns whether a box is finite and not empty, so that its triangle belongs in a tree.
pub(crate) fn is_usable(b: &Aabb) -> bool {
    (0..3).all(|i| b.min[i] <= b.max[i] && b.min[i].is_finite() && b.max[i].is_finite())
}

/// The usable boxes of a scene.
pub(crate) struct Gathered {
    pub(crate) count: usize,
    pub(crate) extents: PrimExtents,
    /// Factor that all coordinates were multiplied by.
    pub(crate) factor: f32,
}

/// Fills the front of `prims` with all usable boxes, in the order of triangles. `prims` has one entry per triangle.
pub(crate) fn gather<B: Boxes + ?Sized>(boxes: &B, prims: &mut [Prim]) -> Gathered {
    let parts: Vec<_> = prims
        .par_chunks_mut(CHUNK)
        .enumerate()
        .map(|(i, chunk)| gather_chunk(boxes, i * CHUNK, chunk))
        .collect();
    let mut all = Gathered {
        count: 0,
        extents: PrimExtents::EMPTY,
        factor: 1.0,
    };
    for (i, part) in parts.into_iter().enumerate() {
        let start = i * CHUNK;
        if all.count < start {
            prims.copy_within(start..start + part.count, all.count);
        }
        all.count += part.count;
        all.extents = all.extents.union(part.extents);
    }
    if let Some(factor) = safe_factor(&all.extents.boxes) {
        all.factor = factor;
        all.extents = rescale(&mut prims[..all.count], factor);
    }
    all
}

fn gather_chunk<B: Boxes + ?Sized>(boxes: &B, start: usize, chunk: &mut [Prim]) -> Gathered {
    let mut count = 0;
    let mut extents = PrimExtents::EMPTY;
    for i in start..start + chunk.len() {
        let bounds = boxes.get(i as u32);
        if is_usable(&bounds) {
            let prim = Prim::new(&bounds, i as u32);
            extents.add(&prim);
            chunk[count] = prim;
            count += 1;
        }
    }
    Gathered {
        count,
        extents,
        factor: 1.0,
    }
}

/// Returns a factor for all coordinates if the largest is so far from 1 that sums would overflow or small boxes would
/// vanish.
fn safe_factor(all: &PrimBounds) -> Option<f32> {
    let largest = all.lo.abs().max(all.up.abs()).truncate().max_element();
    match largest {
        x if x == 0.0 || !x.is_finite() => None,
        x if x < 2.0_f32.powi(-30) => Some(2.0_f32.powi(120)),
        x if x > 2.0_f32.powi(60) => Some(2.0_f32.powi(-100)),
        _ => None,
    }
}

fn rescale(prims: &mut [Prim], factor: f32) -> PrimExtents {
    prims
        .par_chunks_mut(CHUNK)
        .map(|chunk| {
            for prim in &mut *chunk {
                *prim = prim.scaled(factor);
            }
            PrimExtents::of(chunk)
        })
        .reduce(|| PrimExtents::EMPTY, PrimExtents::union)
}
