//! Extreme rays ([`geom::Range`]): kernels of their own answer them in whole numbers.

use super::{Rays, Work};
use crate::{Params, kernel};
use backend::{Intersector, Method, QueryKind};

/// Which of a query's rays are extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extremes {
    None,
    Some,
    All,
}

/// Which rays kernels leave to [`work`].
pub(super) fn of(method: Method, params: &Params, rays: Rays<'_>) -> Extremes {
    match (method.intersector, rays) {
        (Intersector::MollerTrumbore | Intersector::Woop, _) => Extremes::None,
        _ if params.extreme != 0 => Extremes::All,
        (_, Rays::Given(_, true)) => Extremes::Some,
        (_, Rays::Camera(camera)) if params.is_extreme(camera.eye) => Extremes::All,
        _ => Extremes::None,
    }
}

/// What answers them. Comes after what answers the others, as which these rays miss.
pub(super) fn work(
    method: Method,
    mut params: Params,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Vec<Work> {
    params.rule = (method.intersector == Intersector::Watertight).into();
    let params = match rays {
        Rays::Given(..) => params,
        Rays::Camera(camera) => params.through(camera),
    };
    let over = |entry, params| Work::linear(kernel(entry, method), params, rays.count());
    match kind {
        QueryKind::Any => vec![over("extreme_any_rays", params)],
        QueryKind::Closest => vec![over("extreme_rays", params)],
        // In the scene's units, unlike everywhere else.
        QueryKind::ClosestAndShadow { light } => {
            let lit = Params { light, ..params };
            vec![
                over("extreme_rays", params),
                over("extreme_shadow_rays", lit),
            ]
        }
    }
}
