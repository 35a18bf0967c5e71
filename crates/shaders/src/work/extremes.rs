//! Rays that are answered in exact arithmetic: see "Extreme rays" in `docs/design/hits.md`.

use super::{Groups, Rays, Work};
use crate::{Kernel, Params, common};
use backend::{Intersector, Method, QueryKind};
use geom::Range;

/// How many of a query's rays are extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extremes {
    None,
    /// So far as anybody knows.
    Some,
    All,
}

/// Invocations that look for extreme rays where most are none.
const SEEKERS: u32 = 1 << 16;

/// Whether extreme rays are answered otherwise than the rest.
fn has_extremes(method: Method) -> bool {
    matches!(
        method.intersector,
        Intersector::Watertight | Intersector::Exact
    )
}

impl Extremes {
    /// Of rays that other kernels leave to [`work`].
    pub(super) fn among(method: Method, params: &Params, rays: Rays<'_>) -> Self {
        match rays {
            _ if !has_extremes(method) => Self::None,
            _ if params.extreme == 1 => Self::All,
            Rays::Camera(camera) if params.is_extreme(camera.eye) => Self::All,
            Rays::Given(_, true) => Self::Some,
            _ if params.is_unknown() => Self::Some,
            _ => Self::None,
        }
    }
}

/// What answers them. Comes after what answers the others, as which these rays miss; where nobody knew which they are, it
/// answers them anew.
pub(super) fn work(
    method: Method,
    mut params: Params,
    (rays, how): (Rays<'_>, Extremes),
    kind: QueryKind,
) -> Vec<Work> {
    params.rule = (method.intersector == Intersector::Watertight).into();
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
        // In the scene's units, unlike everywhere else.
        QueryKind::ClosestAndShadow { light } => {
            let lit = Params { light, ..params };
            vec![hits, over("extreme_shadow_rays", lit)]
        }
    }
}

/// Kernels that follow [`measure_range`], and its own.
pub fn kernels_of_arriving_keys(method: Method) -> impl Iterator<Item = &'static Kernel> {
    let both = ["measure_range", "extreme_rays"].map(common);
    both.into_iter().filter(move |_| has_extremes(method))
}

/// Where nobody knows how far the coordinates of a key frame of so many vertices reach, finds that out: into
/// [`crate::BufferName::Range`], which is read by what answers extreme rays alone.
pub fn measure_range(method: Method, mut params: Params, vertices: usize) -> Option<Work> {
    let is_asked = params.is_unknown() && has_extremes(method);
    params.first = Range::sample_step(vertices) as u32;
    is_asked.then(|| Work::linear(common("measure_range"), params, vertices as u32))
}
