//! Closed bodies.

use crate::Case;
use crate::leaks::{self, LeakPlan};
use crate::stage::plainly;
use backend::{Backend, Method};

/// Rays of one case.
const RAYS: u64 = 240;

/// No ray leaves a closed body without a hit, and crossings add up.
pub(crate) fn leaks(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let offsets = leaks::OFFSETS;
    let plan = LeakPlan {
        seed: case.chance,
        rays: RAYS,
        offsets: vec![offsets[case.chance as usize % offsets.len()]],
        method: Method::default(),
    };
    let found = leaks::run(subject, &plan, &mut |_| {}).map_err(plainly)?;
    found
        .first
        .first()
        .map_or(Ok(()), |leak| Err(leak.to_string()))
}
