//! Hits determined by a driver, which must be within rounding of the exact ones. See [`crate::rounding`].

use super::Check;
use super::answers::{self, asked};
use crate::Case;
use crate::compare::{named_ray, same_counts, triangle_text};
use crate::rounding::Verifier;
use anyhow::{Result, bail, ensure};
use backend::{FrameReport, Hits, QueryKind, Rays};
use geom::{Hit, Ray};

/// Tests the closest hits of listed rays and of a camera's rays.
pub(super) fn closest(c: &mut Check<'_>) -> Result<()> {
    answers::closest(c, verify)?;
    let camera = Rays::Camera(&c.case.camera);
    asked(c, camera, QueryKind::Closest, verify)
}

/// Tests that rays generated from a camera have the same hits as the same rays in a list.
///
/// Skips cases with rays for which a driver's results are not defined.
pub(super) fn camera_is_rays(c: &mut Check<'_>) -> Result<()> {
    let verifier = Verifier::new(&c.case.animation, c.case.times[1]);
    match c.case.camera.rays().all(|ray| verifier.admits(&ray)) {
        true => answers::camera_is_rays(c),
        false => Ok(()),
    }
}

/// Checks that results are within rounding. Inactive and degenerate triangles must be counted like the reference's, and
/// hits as found.
pub(super) fn verify(
    c: &mut Check<'_>,
    time: f64,
    (rays, kind): (Rays<'_>, QueryKind),
    (found, report): &(Hits, FrameReport),
) -> Result<()> {
    found_within(c.case, time, (rays, kind), found)?;
    let mut right = c.reference.answer(c.case, (c.method, time), None)?.report;
    let hits = found.closest.iter().filter(|h| h.is_hit()).count() as u64;
    let blocked = found.blocked.iter().filter(|&&b| b == 1).count() as u64;
    (right.hits, right.blocked) = match kind {
        QueryKind::Any => (blocked, 0),
        _ => (hits, blocked),
    };
    same_counts(report, &right)
}

fn found_within(
    case: &Case,
    time: f64,
    (asked, kind): (Rays<'_>, QueryKind),
    found: &Hits,
) -> Result<()> {
    let verifier = Verifier::new(&case.animation, time);
    let rays = match asked {
        Rays::List(list) => list.to_vec(),
        Rays::Camera(camera) => camera.rays().collect(),
        Rays::OnDevice(_) => Vec::new(),
    };
    let expected = match kind {
        QueryKind::Any => [0, rays.len()],
        QueryKind::Closest => [rays.len(), 0],
        QueryKind::ClosestAndShadow { .. } => [rays.len(); 2],
    };
    let lengths = [found.closest.len(), found.blocked.len()];
    let same = lengths == expected;
    ensure!(same, "{lengths:?} answers, expected {expected:?}");
    let refuted = |(i, ray)| {
        let (hit, blocked) = (found.closest.get(i), found.blocked.get(i));
        let (hit, blocked) = (hit.copied().unwrap_or(Hit::MISS), blocked == Some(&1));
        let why = refutes(&verifier, kind, (ray, &hit, blocked))?;
        let ray = named_ray(asked, i);
        let triangle = triangle_text(&case.animation, time, hit.triangle);
        Some(format!(
            "at time {time:?}: {hit:?}, blocked {blocked}: {why}, which no rounding explains; {ray}; {triangle}"
        ))
    };
    let mut all = rays.iter().enumerate().filter_map(refuted);
    match all.next() {
        None => Ok(()),
        Some(first) => bail!("{first} (and {} more)", all.count()),
    }
}

fn refutes(
    verifier: &Verifier,
    kind: QueryKind,
    (ray, hit, blocked): (&Ray, &Hit, bool),
) -> Option<String> {
    if !ray.is_valid() && (hit.is_hit() || blocked) {
        return Some("the ray can hit nothing".to_owned());
    }
    if !verifier.admits(ray) {
        return None;
    }
    match kind {
        QueryKind::Any => verifier.refutes_any(ray, blocked),
        QueryKind::Closest => verifier.refutes(ray, hit),
        QueryKind::ClosestAndShadow { light } => verifier
            .refutes(ray, hit)
            .or_else(|| verifier.refutes_shadow(ray, hit, light, blocked)),
    }
}
