//! Dispatches for extreme rays, in exact arithmetic: see "Extreme rays" in `docs/design/hits.md`.

use super::{Groups, Rays, Work};
use crate::{Kernel, Params, common};
use backend::{Intersector, QueryKind};
use geom::Range;

/// How many of a query's rays are extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extremes {
    None,
    /// Possibly some.
    Some,
    All,
}

/// Number of invocations that search for extreme rays if most rays are not extreme.
const SEEKERS: u32 = 1 << 16;

/// Returns whether separate kernels answer extreme rays.
fn has_extremes(intersector: Intersector) -> bool {
    matches!(intersector, Intersector::Watertight | Intersector::Exact)
}

impl Extremes {
    /// Returns which of the rays other kernels leave to [`work`].
    pub(super) fn among(intersector: Intersector, params: &Params, rays: Rays<'_>) -> Self {
        match rays {
            _ if !has_extremes(intersector) => Self::None,
            _ if params.extreme == 1 => Self::All,
            Rays::Camera(camera) if params.is_extreme(camera.eye) => Self::All,
            Rays::Given(..) => Self::Some,
            _ if params.is_unknown() => Self::Some,
            _ => Self::None,
        }
    }
}

/// Returns the dispatches that answer extreme rays. They must follow those for all other rays, which treat extreme rays as
/// misses. If it was unknown which rays are extreme, they overwrite earlier answers.
pub(super) fn work(
    intersector: Intersector,
    mut params: Params,
    (rays, how): (Rays<'_>, Extremes),
    kind: QueryKind,
) -> Vec<Work> {
    params.rule = (intersector == Intersector::Watertight).into();
    params.rounds = if kind == QueryKind::Any { 1 } else { 4 };
    let params = match rays {
        Rays::Given(..) => params,
        Rays::Camera(camera) if params.is_extreme(camera.eye) => params.known().through(camera),
        Rays::Camera(camera) => params.through(camera),
    };
    let sharers = match how {
        Extremes::All => rays.count(),
        _ => rays.count().min(SEEKERS),
    };
    let over = |entry, params| Work {
        groups: Groups::Linear(sharers),
        ..Work::linear(common(entry), params, rays.count())
    };
    let hits = over("extreme_rays", params);
    match kind {
        QueryKind::Any | QueryKind::Closest => vec![hits],
        // In scene units; all other kernels use scaled units.
        QueryKind::ClosestAndShadow { light } => {
            let lit = Params { light, ..params };
            vec![hits, over("extreme_shadow_rays", lit)]
        }
    }
}

/// Returns the kernel of [`measure_range`] and the one that needs its result.
pub fn kernels_of_arriving_keys(intersector: Intersector) -> impl Iterator<Item = &'static Kernel> {
    let both = ["measure_range", "extreme_rays"].map(common);
    both.into_iter().filter(move |_| has_extremes(intersector))
}

/// Returns the dispatch that measures the coordinates of a key frame of `vertices` vertices, or `None` if their range is
/// known or not needed. It writes [`crate::BufferName::Range`], which only the kernels for extreme rays read.
pub fn measure_range(
    intersector: Intersector,
    mut params: Params,
    vertices: usize,
) -> Option<Work> {
    let is_asked = params.is_unknown() && has_extremes(intersector);
    params.first = Range::sample_step(vertices) as u32;
    is_asked.then(|| Work::linear(common("measure_range"), params, vertices as u32))
}
