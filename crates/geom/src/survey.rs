//! What all key frames of an animation tell together, seen one after another.

use crate::key_frames::KeyFrames;
use crate::range::Ranges;
use crate::sizes::{Parts, Sizes};
use crate::still::{bits, keeps_its_bits};
use crate::{Aabb, Animation, KeyFrame, KeyFrameError, Point, Range, StaticParts, is_active};
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
    /// Of key frames to come.
    parts: Option<Parts>,
}

/// Vertices that one task looks at.
const RUN: usize = 1 << 16;

impl Survey {
    /// Looks at all key frames, one after another.
    pub(crate) fn of(keys: &KeyFrames, triangles: &[[u32; 3]]) -> Result<Self, KeyFrameError> {
        let first = keys.first();
        let mut measured = vec![Measured::of(first)];
        let mut is_static = vec![true; first.len()];
        let mut fallback_corners = Vec::new();
        // Triangles that no key frame has had active so far.
        let mut inactive: Vec<u32> = Vec::new();
        if !measured[0].finite {
            let all = (0..triangles.len() as u32).into_par_iter();
            let none = |&t: &u32| !is_active(&corners(first, triangles[t as usize]));
            inactive = all.filter(none).collect();
        }
        keys.for_each_after_first(|frame| {
            let is_first_blend = measured.len() == 1;
            let pairs = first.par_iter().zip(frame);
            let each = is_static.par_iter_mut().with_min_len(RUN).zip(pairs);
            each.for_each(|(is_static, (a, b))| {
                let stays = !is_first_blend || keeps_its_bits(a);
                *is_static = *is_static && stays && bits(a) == bits(b);
            });
            measured.push(Measured::of(frame));
            inactive.retain(|&t| {
                let corners = corners(frame, triangles[t as usize]);
                let active = is_active(&corners);
                if active {
                    fallback_corners.push((t, Aabb::of_triangle(&corners)));
                }
                !active
            });
        })?;
        fallback_corners.sort_unstable_by_key(|&(t, _)| t);
        let sizes: Vec<Sizes> = measured.iter().map(|m| m.sizes).collect();
        let ranges = Ranges::of(&sizes);
        Ok(Self {
            fallback_corners,
            never_active: inactive.len() as u32,
            static_parts: StaticParts::of(is_static, first, triangles),
            parts: None,
            ranges,
            bounds: measured.iter().map(|m| m.bounds).collect(),
            magnitude: match measured.iter().all(|m| m.finite) {
                true => sizes.iter().fold(0.0, |m, s| f32::max(m, s.largest)),
                false => f32::INFINITY,
            },
        })
    }

    /// Looks at the first of key frames that are to come, in which only the vertices that are not `fixed` may move,
    /// anywhere. Any triangle may become active: one that is not yet is built over a point.
    pub(crate) fn before(
        keys: &KeyFrames,
        triangles: &[[u32; 3]],
        fixed: &[bool],
    ) -> Result<Self, KeyFrameError> {
        let first = keys.first();
        let marks = first.iter().zip(fixed);
        let is_static = marks.map(|(p, &fixed)| fixed && keeps_its_bits(p));
        let somewhere = first.iter().find(|p| p.iter().all(|x| x.is_finite()));
        let point = Aabb::EMPTY.with_point(*somewhere.unwrap_or(&[0.0; 3]));
        let survey = Self::of(keys, triangles)?;
        // Mostly there are none to look for.
        let absent = triangles.iter().zip(0..);
        let absent = absent.filter(|&(&t, _)| !is_active(&corners(first, t)));
        let absent = absent.take(survey.never_active as usize);
        let static_parts = StaticParts::of(is_static.collect(), first, triangles);
        Ok(Self {
            fallback_corners: absent.map(|(_, t)| (t, point)).collect(),
            never_active: 0,
            parts: Some(Parts::of(first, &static_parts.moving_runs(RUN))),
            static_parts,
            ..survey
        })
    }

    /// How far the coordinates of a key frame reach that came later. It differs from the first as was said [before](Self::before).
    pub(crate) fn range_of(&self, frame: &KeyFrame) -> Range {
        let sizes = match &self.parts {
            Some(parts) => Sizes::of_new(frame, parts),
            None => Sizes::of(frame),
        };
        Range::of(&sizes, self.ranges.scale_exponent)
    }
}

/// What one key frame tells by itself.
struct Measured {
    sizes: Sizes,
    /// Of its finite vertices.
    bounds: Aabb,
    /// Whether all are.
    finite: bool,
}

impl Measured {
    fn of(frame: &[Point]) -> Self {
        let (bounds, finite) = frame
            .par_chunks(RUN)
            .map(bounds)
            .reduce(|| (Aabb::EMPTY, true), |a, b| (a.0.union(b.0), a.1 && b.1));
        Self {
            sizes: Sizes::of(frame),
            bounds,
            finite,
        }
    }
}

/// The finite vertices' box, and whether all are.
fn bounds(points: &[Point]) -> (Aabb, bool) {
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
