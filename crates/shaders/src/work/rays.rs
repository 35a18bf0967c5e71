//! What goes with a tree of the driver's: kernels that cleanse and count, and the parameters of rays.

use super::{Work, tree::word_of};
use crate::{BufferName, Counts, Params, common};
use backend::{Query, QueryKind, Rays};
use geom::Point;
use std::mem::offset_of;

/// So many triangles to vertices of their own, three each; those not to be hit are drawn together to a point.
pub fn cleanse(mut params: Params, triangles: u32, point: Point) -> Work {
    params.eye = point;
    Work::linear(common("cleanse"), params, triangles)
}

/// What counts the answers to a query of so many rays, each with the buffer that it reads for [`BufferName::Answers`].
pub fn count_answers(
    params: Params,
    kind: QueryKind,
    count_of_rays: u32,
) -> Vec<(Work, BufferName)> {
    let count = |member, answers, [rounds, shift, goal]: [u32; 3]| {
        let params = Params {
            first: word_of(member),
            rounds,
            shift,
            goal,
            ..params
        };
        let work = Work::linear(common("count_answers"), params, count_of_rays);
        (work, answers)
    };
    // The last of a hit's four words is the triangle.
    let words = [4, 3, u32::MAX];
    let hits = || count(offset_of!(Counts, hits), BufferName::Hits, words);
    let occluded = |member| count(member, BufferName::Occluded, [1, 0, 0]);
    match kind {
        QueryKind::Any => vec![occluded(offset_of!(Counts, hits))],
        QueryKind::Closest => vec![hits()],
        QueryKind::ClosestAndShadow { .. } => vec![hits(), occluded(offset_of!(Counts, blocked))],
    }
}

/// The parameters of a query's rays, which are `given` one by one or made by the shaders.
pub fn rays(params: Params, query: &Query<'_>, given: bool) -> Params {
    let mut params = match query.rays {
        Rays::Camera(camera) if !given => params.through(camera),
        _ => params,
    };
    params.count = query.rays.count() as u32;
    if let QueryKind::ClosestAndShadow { light } = query.kind {
        params = params.lit(light);
    }
    params
}
