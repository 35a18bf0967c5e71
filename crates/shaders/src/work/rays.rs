//! What goes with a tree of the driver's: kernels that cleanse and count, and the parameters of rays.

use super::Work;
use crate::{Params, common};
use backend::{Query, QueryKind, Rays};
use geom::Point;

/// Where in [`crate::Counts`] a count lies, in words.
const HITS: u32 = 2;
const BLOCKED: u32 = 3;

/// So many triangles to vertices of their own, three each; those not to be hit are drawn together to a point.
#[must_use]
pub fn cleanse(params: Params, triangles: u32, point: Point) -> Work {
    let params = Params {
        eye: point,
        ..params
    };
    Work::linear(common("cleanse"), params, triangles)
}

/// Inactive and degenerate ones among so many triangles.
#[must_use]
pub fn count_triangles(params: Params, triangles: u32) -> Work {
    Work::linear(common("count_triangles"), params, triangles)
}

/// Hits among so many closest hits.
#[must_use]
pub fn count_hits(params: Params, rays: u32) -> Work {
    Work::linear(common("count_hits"), params, rays)
}

/// Those among so many rays that met anything.
#[must_use]
pub fn count_any(params: Params, rays: u32) -> Work {
    let params = Params {
        first: HITS,
        ..params
    };
    Work::linear(common("count_occluded"), params, rays)
}

/// Those among so many hits that lie in shadow.
#[must_use]
pub fn count_occluded(params: Params, rays: u32) -> Work {
    let params = Params {
        first: BLOCKED,
        ..params
    };
    Work::linear(common("count_occluded"), params, rays)
}

/// The parameters of a query's rays, which are `given` one by one or made by the shaders.
#[must_use]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Counts;
    use std::mem::offset_of;

    #[test]
    fn counts_go_to_their_places() {
        let word = |offset: usize| (offset / 4) as u32;
        assert_eq!(HITS, word(offset_of!(Counts, hits)));
        assert_eq!(BLOCKED, word(offset_of!(Counts, blocked)));
        let of = |work: Work| (work.params.first, work.params.count);
        assert_eq!(of(count_any(Params::default(), 7)), (HITS, 7));
        assert_eq!(of(count_occluded(Params::default(), 7)), (BLOCKED, 7));
    }
}
