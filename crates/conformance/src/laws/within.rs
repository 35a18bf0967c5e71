//! What rays hit where a driver decides: within rounding of the exact answer. See [`crate::rounding`].

use crate::Case;
use crate::case::triangle_text;
use crate::compare::named_ray;
use crate::rounding::Verifier;
use crate::stage::{ask, open, plainly, stand, stand_on, start};
use backend::{Backend, Hits, QueryKind, Rays};
use geom::{Hit, Ray};

/// What is asked of the case, and by which rays.
#[derive(Clone, Copy)]
struct Question<'a> {
    rays: Rays<'a>,
    kind: QueryKind,
}

/// Closest hits of given rays and of a camera's.
pub(crate) fn closest(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    for rays in [Rays::List(&case.rays), Rays::Camera(&case.camera)] {
        let kind = QueryKind::Closest;
        judge(case, subject, Question { rays, kind })?;
    }
    Ok(())
}

/// Whether anything is hit.
pub(crate) fn any(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (rays, kind) = (Rays::List(&case.rays), QueryKind::Any);
    judge(case, subject, Question { rays, kind })
}

/// Hits and shadows of given rays and of a camera's.
pub(crate) fn picture(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    for rays in [Rays::Camera(&case.camera), Rays::List(&case.rays)] {
        let kind = QueryKind::ClosestAndShadow { light: case.light };
        judge(case, subject, Question { rays, kind })?;
    }
    Ok(())
}

/// Trees made anew and trees brought along take turns.
fn judge(case: &Case, subject: &mut dyn Backend, question: Question<'_>) -> Result<(), String> {
    open(subject, &case.animation, case.times[0])?;
    for (i, &time) in case.times.iter().enumerate() {
        let stood = if i % 2 == 0 { stand } else { stand_on };
        stood(subject, &case.animation, time)?;
        let found = ask(subject, question.rays, question.kind)?;
        answers(case, time, question, &found)?;
    }
    Ok(())
}

fn answers(case: &Case, time: f64, question: Question<'_>, found: &Hits) -> Result<(), String> {
    let judge = Verifier::new(&case.animation, time);
    let rays = listed(question.rays);
    let expected = match question.kind {
        QueryKind::Any => [0, rays.len()],
        QueryKind::Closest => [rays.len(), 0],
        QueryKind::ClosestAndShadow { .. } => [rays.len(); 2],
    };
    let lengths = [found.closest.len(), found.blocked.len()];
    if lengths != expected {
        return Err(format!("{lengths:?} answers, expected {expected:?}"));
    }
    let refuted = |(i, ray)| {
        let (hit, blocked) = (found.closest.get(i), found.blocked.get(i));
        let (hit, blocked) = (hit.copied().unwrap_or(Hit::MISS), blocked == Some(&1));
        let why = refutes(case, &judge, question.kind, (ray, &hit, blocked))?;
        let ray = named_ray(case, question.rays, i);
        let triangle = triangle_text(&case.animation, time, hit.triangle);
        Some(format!(
            "at time {time:?}: {hit:?}, blocked {blocked}: {why}, which no rounding explains; {ray}; {triangle}"
        ))
    };
    let mut all = rays.iter().enumerate().filter_map(refuted);
    match all.next() {
        None => Ok(()),
        Some(first) => Err(format!("{first} (and {} more)", all.count())),
    }
}

fn refutes(
    case: &Case,
    judge: &Verifier,
    kind: QueryKind,
    (ray, hit, blocked): (&Ray, &Hit, bool),
) -> Option<String> {
    if !ray.is_valid() && (hit.is_hit() || blocked) {
        return Some("the ray can hit nothing".to_owned());
    }
    if !judge.admits(ray) {
        return None;
    }
    match kind {
        QueryKind::Any => judge.refutes_any(ray, blocked),
        QueryKind::Closest => judge.refutes(ray, hit),
        QueryKind::ClosestAndShadow { light } => judge.refutes(ray, hit).or_else(|| {
            let extent = case.animation.bounds().extent();
            let extent = extent.into_iter().fold(0.0, f32::max);
            judge.refutes_shadow(hit, light, f64::from(extent), blocked)
        }),
    }
}

fn listed(rays: Rays<'_>) -> Vec<Ray> {
    match rays {
        Rays::List(list) => list.to_vec(),
        Rays::Camera(camera) => camera.rays().collect(),
    }
}

/// Inactive and degenerate triangles are counted as by the reference, and hits as they were found.
pub(crate) fn counts(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let kind = QueryKind::ClosestAndShadow { light: case.light };
    let rays = Rays::Camera(&case.camera);
    open(subject, &case.animation, case.times[0])?;
    open(reference, &case.animation, case.times[0])?;
    for &time in &case.times {
        stand(subject, &case.animation, time)?;
        stand(reference, &case.animation, time)?;
        let ticket = start(subject, rays, kind)?;
        let seen = subject.wait(ticket).map_err(plainly)?;
        let mut hits = Hits::default();
        subject.hits(ticket, &mut hits).map_err(plainly)?;
        let ticket = start(reference, rays, kind)?;
        let expected = reference.wait(ticket).map_err(plainly)?;
        let found = hits.closest.iter().filter(|h| h.is_hit()).count() as u64;
        let blocked = hits.blocked.iter().filter(|&&b| b == 1).count() as u64;
        let seen = [seen.inactive, seen.degenerate, seen.hits, seen.blocked];
        let expected = [expected.inactive, expected.degenerate, found, blocked];
        if seen != expected {
            return Err(format!(
                "inactive, degenerate, hits, blocked are {seen:?} at time {time:?}, expected {expected:?}"
            ));
        }
    }
    Ok(())
}
