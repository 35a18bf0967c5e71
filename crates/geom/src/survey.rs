//! What all key frames of an animation tell together, seen one after another.

use crate::key_frames::KeyFrames;
use crate::range::{Ranges, Sizes, has_tiny};
use crate::still::{bits, keeps_its_bits};
use crate::{Aabb, Animation, KeyFrameError, Point, StaticParts, is_active};
use rayon::prelude::*;

/// Facts that hold for the whole motion.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    /// Triangles that are inactive in the first key frame, and their boxes in the first that has them active.
    pub(crate) fallback_corners: Vec<(u32, Aabb)>,
    pub(crate) never_active: u32,
    pub(crate) static_parts: StaticParts,
    pub(crate) ranges: Ranges,
    /// Of each key frame's finite vertices.
    pub(crate) bounds: Vec<Aabb>,
    /// The largest `|coordinate|`; infinite if one is not finite.
    pub(crate) magnitude: f32,
}

impl Survey {
    /// Looks at all key frames.
    pub(crate) fn of(keys: &KeyFrames, triangles: &[[u32; 3]]) -> Result<Self, KeyFrameError> {
        let mut surveyor = Surveyor::new(keys.first(), triangles);
        keys.for_each_after_first(|frame| surveyor.see(frame))?;
        surveyor.finish(keys)
    }
}

/// Sees key frames in their order.
struct Surveyor<'a> {
    first: &'a [Point],
    triangles: &'a [[u32; 3]],
    is_static: Vec<bool>,
    /// Triangles that no key frame has had active so far.
    inactive: Vec<u32>,
    fallback_corners: Vec<(u32, Aabb)>,
    sizes: Vec<Sizes>,
    bounds: Vec<Aabb>,
    all_finite: bool,
}

/// The finite vertices' box, and whether all are.
type Bounds = (Aabb, bool);

/// Vertices that one task looks at.
const RUN: usize = 1 << 16;

impl<'a> Surveyor<'a> {
    fn new(first: &'a [Point], triangles: &'a [[u32; 3]]) -> Self {
        let mut made = Self {
            first,
            triangles,
            is_static: vec![true; first.len()],
            inactive: Vec::new(),
            fallback_corners: Vec::new(),
            sizes: Vec::new(),
            bounds: Vec::new(),
            all_finite: true,
        };
        made.measure(first);
        if !made.all_finite {
            let all = (0..triangles.len() as u32).into_par_iter();
            let inactive = |&t: &u32| !is_active(&corners(first, triangles[t as usize]));
            made.inactive = all.filter(inactive).collect();
        }
        made
    }

    /// Looks at the next key frame.
    fn see(&mut self, frame: &[Point]) {
        let is_first_blend = self.sizes.len() == 1;
        let pairs = self.first.par_iter().zip(frame);
        let each = self.is_static.par_iter_mut().with_min_len(RUN).zip(pairs);
        each.for_each(|(is_static, (a, b))| {
            let stays = !is_first_blend || keeps_its_bits(a);
            *is_static = *is_static && stays && bits(a) == bits(b);
        });
        self.measure(frame);
        let (triangles, found) = (self.triangles, &mut self.fallback_corners);
        self.inactive.retain(|&t| {
            let corners = corners(frame, triangles[t as usize]);
            let active = is_active(&corners);
            if active {
                found.push((t, Aabb::of_triangle(&corners)));
            }
            !active
        });
    }

    fn measure(&mut self, frame: &[Point]) {
        let (bounds, finite) = frame
            .par_chunks(RUN)
            .map(bounds)
            .reduce(|| (Aabb::EMPTY, true), |a, b| (a.0.union(b.0), a.1 && b.1));
        self.sizes.push(Sizes::of(frame));
        self.bounds.push(bounds);
        self.all_finite &= finite;
    }

    /// What all of them tell. Looks again at those that need it.
    fn finish(mut self, keys: &KeyFrames) -> Result<Survey, KeyFrameError> {
        self.fallback_corners.sort_unstable_by_key(|&(t, _)| t);
        let largest = self.sizes.iter().fold(0.0_f32, |m, s| m.max(s.largest));
        let triangles = self.triangles;
        let ranges = Ranges::of(&self.sizes, |key, least| {
            let frame = keys.get(key)?;
            Ok(has_tiny(&frame, triangles, least))
        })?;
        Ok(Survey {
            fallback_corners: self.fallback_corners,
            never_active: self.inactive.len() as u32,
            static_parts: StaticParts::of(self.is_static, self.first, triangles),
            ranges,
            bounds: self.bounds,
            magnitude: if self.all_finite {
                largest
            } else {
                f32::INFINITY
            },
        })
    }
}

fn bounds(points: &[Point]) -> Bounds {
    let none = (Aabb::EMPTY, true);
    points.iter().fold(none, |(bounds, all), &p| {
        match p.iter().all(|x| x.is_finite()) {
            true => (bounds.with_point(p), all),
            false => (bounds, false),
        }
    })
}

fn corners(frame: &[Point], triangle: [u32; 3]) -> crate::Triangle {
    triangle.map(|v| frame[v as usize])
}

/// Every triangle must name vertices that exist, and there may not be too many.
pub(crate) fn check_triangles(
    triangles: &[[u32; 3]],
    vertices: usize,
) -> Result<(), KeyFrameError> {
    let (count, limit) = (triangles.len(), Animation::MAX_TRIANGLES);
    if count > limit {
        let cause = format!("{count} triangles are more than the limit of {limit}");
        return Err(KeyFrameError(cause));
    }
    let out = |corners: &[u32; 3]| corners.iter().any(|&v| v as usize >= vertices);
    let Some(triangle) = triangles.par_iter().position_first(out) else {
        return Ok(());
    };
    let vertex = triangles[triangle]
        .iter()
        .find(|&&v| v as usize >= vertices);
    Err(KeyFrameError(format!(
        "triangle {triangle} names vertex {}, but there are {vertices}",
        vertex.expect("it was found")
    )))
}
