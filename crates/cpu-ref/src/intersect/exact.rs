//! The exact test: rounded arithmetic with proven error bounds, and integers where the bounds do not suffice.
//!
//! The rounded part is a filter in the sense of Shewchuk (1997) on the watertight test's
//! numbers. The bounds and their proof are in `docs/design/hits.md`.

use super::watertight::{Shear, Watertight, solve};
use super::{Asked, Search, TriangleTest};
use crate::extreme::Rule;
use crate::scale::{LEAST, Limits, PreparedRay};
use crate::traverse::{Leaf, Stack, Tree};
use geom::Hit;
use geom::exact::{ExactDistance, RoundedHit};
use glam::Vec4;
use std::cmp::Ordering;
use std::sync::atomic::Ordering::Relaxed;

/// The test whose results equal those of exact arithmetic for every ray.
pub struct Exact;

/// A triangle that error bounds do not exclude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Place of the triangle in the tree.
    place: usize,
    /// Set if the hit is certain and within the ray's limits.
    sure: bool,
    /// Interval `low..=high` of the exact `t`, if the triangle is hit.
    low: f32,
    high: f32,
}

/// A ray in the forms that [`judge`] reads.
struct Seen {
    ray: PreparedRay,
    shear: Shear,
    /// Limits between which every `t` rounds to one within the ray's limits.
    sure: Limits,
}

impl Seen {
    fn new<N>(asked: &Asked<'_, N>) -> Option<Self> {
        let ray = PreparedRay::new(&asked.ray, asked.scale)?;
        Some(Self {
            shear: Watertight::prepare(&ray),
            sure: ray.sure_limits(),
            ray,
        })
    }
}

/// Bound on the error of a sheared coordinate relative to the size of its terms, `9.5 * 2^-24`.
pub const SHEAR: f32 = 9.5 / 16_777_216.0;
/// Bound on the error of a depth relative to its size, `32 * 2^-24`.
pub const DEPTH: f32 = 32.0 / 16_777_216.0;
/// Bound on the error from flushing small numbers to zero, `2^-60`.
pub const SMALL: f32 = f32::from_bits((127 - 60) << 23);

impl<N: Tree> Search<N> for Exact {
    const EXTREMES: Option<Rule> = Some(Rule::Closed);

    fn closest(asked: &Asked<'_, N>, stack: &mut Stack<N>) -> Option<Hit> {
        let seen = Seen::new(asked)?;
        let (waiting, candidates) = (&mut stack.waiting, &mut stack.candidates);
        candidates.clear();
        asked.tree.visit(&seen.ray, waiting, |leaf, bound| {
            let candidate = judge(asked.tree, &seen, leaf).filter(|c| c.low <= bound);
            candidates.extend(candidate);
            let sure = candidate.filter(|c| c.sure);
            Some(sure.map_or(bound, |c| bound.min(c.high)))
        });
        nearest(asked, seen.ray.t_max, candidates)
    }

    fn any(asked: &Asked<'_, N>, skipped: Option<u32>, stack: &mut Stack<N>) -> bool {
        let other = |place: usize| skipped.is_none() || asked.tree.triangle(place) != skipped;
        let Some(seen) = Seen::new(asked) else {
            return false;
        };
        let (waiting, candidates) = (&mut stack.waiting, &mut stack.candidates);
        candidates.clear();
        let blocked = asked.tree.visit(&seen.ray, waiting, |leaf, bound| {
            let candidate = judge(asked.tree, &seen, leaf).filter(|c| other(c.place));
            candidates.extend(candidate);
            (!candidate.is_some_and(|c| c.sure)).then_some(bound)
        });
        if blocked || candidates.is_empty() {
            return blocked;
        }
        asked.settled.fetch_add(1, Relaxed);
        let mut open = candidates.iter();
        open.any(|c| meet(asked, c.place).is_some())
    }
}

/// Tests a leaf's triangle in rounded arithmetic. Returns `None` for a certain miss.
#[inline(always)]
fn judge<N: Tree>(tree: N, Seen { shear, sure, .. }: &Seen, leaf: &Leaf) -> Option<Candidate> {
    let sheared = shear.apply(&tree.record::<Watertight>(leaf.place));
    let edges = sheared.edges();
    let largest = |v: Vec4| v.abs().truncate().max_element();
    let wide = largest(sheared.x).max(largest(sheared.y));
    let slack = SHEAR * (wide + 2.0 * largest(sheared.along)) + SMALL;
    let doubt = slack * (4.0 * wide + 2.0 * slack);
    let (least, most) = (
        edges.truncate().min_element(),
        edges.truncate().max_element(),
    );
    if least < -doubt && most > doubt {
        return None;
    }
    let certain = (least > doubt || most < -doubt) && edges.truncate().is_finite();
    let depths = shear.depths(&sheared);
    let t = solve(edges, depths).t;
    let [low, high] = span(leaf, t, (edges, depths), certain.then_some(doubt));
    Some(Candidate {
        place: leaf.place,
        sure: certain && low > sure.after && high < sure.before,
        low,
        high,
    })
}

/// Returns the interval of the exact `t`: the triangle's own box, and near the rounded `t` if the hit is certain.
#[inline(always)]
fn span(leaf: &Leaf, t: f32, (edges, depths): (Vec4, Vec4), doubt: Option<f32>) -> [f32; 2] {
    let own_box = [leaf.entry, leaf.exit];
    let Some(doubt) = doubt else {
        return own_box;
    };
    let least_det = (edges.x + edges.y + edges.z).abs() - 4.0 * doubt;
    if least_det.partial_cmp(&(4.0 * doubt)) != Some(Ordering::Greater) {
        return own_box;
    }
    let depths = depths.truncate();
    let spread = depths.max_element() - depths.min_element();
    let size = depths.abs().max_element();
    let of_weights = 3.0 * (doubt * spread + LEAST * (1.0 + size)) / least_det;
    let error = of_weights + DEPTH * size + SMALL;
    let near = [leaf.entry.max(t - error), leaf.exit.min(t + error)];
    if near[0] <= near[1] { near } else { own_box }
}

/// Returns the closest candidate's hit, with its numbers rounded once.
fn nearest<N: Tree>(asked: &Asked<'_, N>, t_max: f32, found: &mut Vec<Candidate>) -> Option<Hit> {
    let surely = found.iter().filter(|c| c.sure).map(|c| c.high);
    let bound = surely.fold(t_max, f32::min);
    found.retain(|c| c.low <= bound);
    let mut is_settled = false;
    let place = match found[..] {
        [] => return None,
        [only] if only.sure => only.place,
        _ => {
            is_settled = true;
            asked.settled.fetch_add(1, Relaxed);
            let crossings = found
                .iter()
                .filter_map(|c| Some((c.place, meet(asked, c.place)?)));
            first(asked, crossings)?.0
        }
    };
    report(asked, place, is_settled)
}

/// The hit of the triangle in a place, its numbers rounded once. Integers that round them are counted unless `is_settled`.
fn report<N: Tree>(asked: &Asked<'_, N>, place: usize, is_settled: bool) -> Option<Hit> {
    let triangle = asked.tree.triangle(place)?;
    let (line, corners) = (asked.line(), asked.geometry.corners(triangle));
    let rounded = line.rounded_surely(&corners).or_else(|| {
        asked.settled.fetch_add(u64::from(!is_settled), Relaxed);
        line.rounded(&corners)
    });
    let RoundedHit { t, u, v } = rounded?;
    Some(Hit { t, u, v, triangle })
}

impl Exact {
    /// The hit of the triangle in a place that the ray surely hits, its numbers rounded once.
    pub fn sure_hit<N: Tree>(asked: &Asked<'_, N>, place: usize) -> Option<Hit> {
        report(asked, place, false)
    }
}

/// Returns the crossing with the least exact `t`, then the least triangle index.
fn first<N: Tree>(
    asked: &Asked<'_, N>,
    crossings: impl Iterator<Item = (usize, ExactDistance)>,
) -> Option<(usize, ExactDistance)> {
    let triangle = |place: usize| asked.tree.triangle(place);
    crossings.reduce(|a, b| {
        let order = a.1.order(&b.1).then(triangle(a.0).cmp(&triangle(b.0)));
        if order.is_gt() { b } else { a }
    })
}

/// Returns the exact crossing with the triangle in a place.
fn meet<N: Tree>(asked: &Asked<'_, N>, place: usize) -> Option<ExactDistance> {
    let triangle = asked.tree.triangle(place)?;
    Rule::Closed.meet(&asked.geometry, &asked.line(), triangle)
}
