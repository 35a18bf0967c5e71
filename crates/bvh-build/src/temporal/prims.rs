//! Reads the boxes of every moment and brings each moment to the size of its own root.

use super::lanes::{Boxes as Lanes8, LANES, Lanes};
use super::{MAX_MOMENTS, Moment};
use crate::Boxes;
use crate::bins::CHUNK;
use crate::gather::is_usable;
use geom::Aabb;
use rayon::prelude::*;

/// Every triangle at every moment, by its number, in units of the root's longest edge then and from the root's middle.
#[derive(Debug, Default)]
pub(super) struct Prims {
    boxes: Vec<Lanes8>,
    /// What an area costs at each moment: its share of the time over the root's area.
    pub(super) weights: Lanes,
    /// The moments at which planes are tried, all different: the first, the middle one and the last.
    ///
    /// More of them took longer and made trees no better. The cost of a plane is that of all moments.
    pub(super) tried: Vec<usize>,
}

impl Prims {
    #[inline]
    pub(super) fn get(&self, triangle: u32) -> &Lanes8 {
        &self.boxes[triangle as usize]
    }

    /// Reads all boxes; `live` becomes the list of the triangles that have one.
    pub(super) fn gather<B: Boxes>(&mut self, moments: &[Moment<B>], live: &mut Vec<u32>) {
        let first = moments.first().expect("a tree is built for some moment");
        let n = first.boxes.triangle_count();
        assert!(moments.len() <= MAX_MOMENTS, "{} moments", moments.len());
        assert!(u32::try_from(n).is_ok(), "{n} triangles cannot be numbered");
        let alike = moments.iter().all(|m| m.boxes.triangle_count() == n);
        assert!(alike, "every moment has the same triangles");
        let last = moments.len() - 1;
        self.tried.clear();
        self.tried.extend([0, last / 2, last]);
        self.tried.dedup();
        self.boxes.resize(n, Lanes8::EMPTY);
        let roots = self
            .boxes
            .par_chunks_mut(CHUNK)
            .enumerate()
            .map(|(i, chunk)| read(moments, i * CHUNK, chunk))
            .reduce(|| [Aabb::EMPTY; LANES], union);
        let frames = roots.map(|root| Frame::of(&root));
        self.weights = weights(moments, &frames);
        self.boxes
            .par_chunks_mut(CHUNK)
            .for_each(|chunk| chunk.iter_mut().for_each(|b| rescale(b, &frames)));
        live.clear();
        let is_live = |&t: &u32| self.boxes[t as usize].rows[0][0] > f32::NEG_INFINITY;
        live.extend((0..n as u32).filter(is_live));
    }
}

fn union(a: [Aabb; LANES], b: [Aabb; LANES]) -> [Aabb; LANES] {
    std::array::from_fn(|l| a[l].union(b[l]))
}

/// Reads a chunk of triangles from `start` on; gives the root at every moment.
fn read<B: Boxes>(moments: &[Moment<B>], start: usize, chunk: &mut [Lanes8]) -> [Aabb; LANES] {
    let mut roots = [Aabb::EMPTY; LANES];
    for (to, triangle) in chunk.iter_mut().zip(start as u32..) {
        let found: [Option<Aabb>; LANES] = std::array::from_fn(|l| {
            let bounds = moments.get(l)?.boxes.get(triangle);
            is_usable(&bounds).then_some(bounds)
        });
        *to = Lanes8::EMPTY;
        let Some(fallback_corner) = found.iter().flatten().next() else {
            continue;
        };
        for (l, bounds) in found.iter().enumerate() {
            let bounds = bounds.unwrap_or(*fallback_corner);
            roots[l] = roots[l].union(bounds);
            for axis in 0..3 {
                to.rows[axis][l] = -bounds.min[axis];
                to.rows[axis + 3][l] = bounds.max[axis];
            }
        }
    }
    roots
}

/// The units of one moment: the middle of its root, and one over its longest edge.
#[derive(Clone, Copy, Debug)]
struct Frame {
    middle: [f64; 3],
    scale: f64,
    half_area: f64,
}

impl Frame {
    /// The least area of a root, in its longest edge squared: that of a point with padded edges.
    const LEAST: f64 = 1.0 / (1_u64 << 40) as f64;

    /// Means nothing where no triangle has a box.
    fn of(root: &Aabb) -> Self {
        let [lo, hi] = [root.min, root.max].map(|c| c.map(f64::from));
        let longest = (0..3).map(|i| hi[i] - lo[i]).fold(0.0, f64::max);
        let scale = if longest > 0.0 { longest.recip() } else { 0.0 };
        Self {
            middle: std::array::from_fn(|i| f64::midpoint(lo[i], hi[i])),
            scale,
            half_area: (root.half_area() * scale * scale).max(Self::LEAST),
        }
    }
}

fn weights<B>(moments: &[Moment<B>], frames: &[Frame; LANES]) -> Lanes {
    let all: f64 = moments.iter().map(|m| m.weight).sum();
    std::array::from_fn(|l| {
        let weight = moments.get(l).map_or(0.0, |m| m.weight);
        // Roots without area and moments without weight must not make NaNs of each other.
        if all > 0.0 {
            (weight / all / frames[l].half_area) as f32
        } else {
            0.0
        }
    })
}

fn rescale(b: &mut Lanes8, frames: &[Frame; LANES]) {
    if b.rows[0][0] == f32::NEG_INFINITY {
        return;
    }
    for (l, frame) in frames.iter().enumerate() {
        for axis in 0..3 {
            let lo = -f64::from(b.rows[axis][l]);
            let hi = f64::from(b.rows[axis + 3][l]);
            let [lo, hi] = [lo, hi].map(|x| ((x - frame.middle[axis]) * frame.scale) as f32);
            (b.rows[axis][l], b.rows[axis + 3][l]) = (-lo, hi);
        }
    }
}
