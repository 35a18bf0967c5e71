//! Dispatches for extreme rays, in exact arithmetic: see "Extreme rays" in `docs/design/hits.md`.

use super::{Groups, RaySource, TraceInput, Work};
use crate::{ExtremesParams, Kernel, MeasureParams, Params, common};
use backend::{Intersector, QueryKind};
use geom::CoordinateRange;

/// How many of a query's rays are extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extremes {
    None,
    /// Possibly some.
    Some,
    All,
}

/// Maximum number of invocations that search for extreme rays among other rays.
const SEARCH_INVOCATIONS: u32 = 1 << 16;

/// Returns whether separate kernels trace extreme rays.
fn has_extremes(intersector: Intersector) -> bool {
    matches!(intersector, Intersector::Watertight | Intersector::Exact)
}

impl Extremes {
    /// Returns how many of the query's rays are extreme rays that [`work`] must trace.
    pub(super) fn among(input: &TraceInput<'_>) -> Self {
        let params = &input.params;
        match input.rays {
            _ if !has_extremes(input.intersector) => Self::None,
            _ if params.extreme == 1 => Self::All,
            RaySource::Camera(camera) if params.is_extreme(camera.eye) => Self::All,
            RaySource::Buffer(..) => Self::Some,
            _ if params.has_unknown_range() => Self::Some,
            _ => Self::None,
        }
    }
}

/// Returns the dispatches that trace extreme rays. They must follow the dispatches for all other rays, which treat extreme
/// rays as misses. If the range was unknown, those dispatches traced some extreme rays too, and the returned dispatches
/// overwrite their results.
pub(super) fn work(input: &TraceInput<'_>, how: Extremes) -> Vec<Work> {
    let TraceInput {
        intersector,
        params,
        rays,
        kind,
    } = *input;
    let params = params.with(ExtremesParams {
        rule: (intersector == Intersector::Watertight).into(),
        answer_words: if kind == QueryKind::Any { 1 } else { 4 },
    });
    let params = match rays {
        RaySource::Buffer(..) => params,
        RaySource::Camera(camera) if params.is_extreme(camera.eye) => {
            params.without_unknown_range().with_camera(camera)
        }
        RaySource::Camera(camera) => params.with_camera(camera),
    };
    let invocations = match how {
        Extremes::All => rays.count(),
        _ => rays.count().min(SEARCH_INVOCATIONS),
    };
    let over = |entry, params| Work {
        groups: Groups::Linear(invocations),
        ..Work::linear(common(entry), params, rays.count())
    };
    let hits = over("extreme_rays", params);
    match kind {
        QueryKind::Any | QueryKind::Closest => vec![hits],
        // Like `shade`, and unlike all other kernels, this kernel reads the light in scene units.
        QueryKind::ClosestAndShadow { light } => {
            let lit = Params { light, ..params };
            vec![hits, over("extreme_shadow_rays", lit)]
        }
    }
}

/// Returns the kernel of [`measure_range`] and the kernel that reads its result. Empty if the intersector has no
/// kernels for extreme rays.
pub fn range_kernels(intersector: Intersector) -> impl Iterator<Item = &'static Kernel> {
    let both = ["measure_range", "extreme_rays"].map(common);
    both.into_iter().filter(move |_| has_extremes(intersector))
}

/// Returns the dispatch that measures the coordinates of a key frame of `vertices` vertices, or `None` if their range is
/// known or not needed. It writes [`crate::BufferName::Range`]. Only `extreme_rays` and [`crate::MODULE`] read the
/// result.
pub fn measure_range(intersector: Intersector, params: Params, vertices: usize) -> Option<Work> {
    let is_needed = params.has_unknown_range() && has_extremes(intersector);
    let sample_step = CoordinateRange::sample_step(vertices) as u32;
    let params = params.with(MeasureParams { sample_step });
    is_needed.then(|| Work::linear(common("measure_range"), params, vertices as u32))
}
