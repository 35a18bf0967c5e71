//! What rays hit.

use crate::Case;
use crate::compare::{answers, named_ray};
use crate::stage::{ask, methods, open_with, plainly, robust_methods, stand};
use backend::{Backend, Hits, Method, QueryKind, Rays};
use geom::Ray;

fn at(
    case: &Case,
    backend: &mut dyn Backend,
    method: Method,
    (rays, kind): (Rays<'_>, QueryKind),
) -> Result<Vec<Hits>, String> {
    open_with(backend, &case.animation, case.times[0], method).map_err(plainly)?;
    let mut all = Vec::new();
    for &time in &case.times {
        stand(backend, &case.animation, time)?;
        all.push(ask(backend, rays, kind)?);
    }
    Ok(all)
}

/// By every method whose answers are the same everywhere.
fn same(
    case: &Case,
    [subject, reference]: [&mut dyn Backend; 2],
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<(), String> {
    for [method, usual] in robust_methods([&*subject, &*reference])? {
        let seen = at(case, subject, method, (rays, kind))?;
        let expected = at(case, reference, usual, (rays, kind))?;
        for (i, (s, r)) in seen.iter().zip(&expected).enumerate() {
            answers(case, case.times[i], rays, s, r).map_err(|e| format!("{method:?}: {e}"))?;
        }
    }
    Ok(())
}

/// Triangle, `t`, `u`, `v`: bit for bit.
pub(crate) fn closest(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    same(case, [subject, reference], rays, QueryKind::Closest)
}

/// Whether anything is hit.
pub(crate) fn any(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    same(case, [subject, reference], rays, QueryKind::Any)
}

/// A camera's rays made on the device, with shadows; and the shadows of given rays.
pub(crate) fn picture(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let kind = QueryKind::ClosestAndShadow { light: case.light };
    let camera = Rays::Camera(&case.camera);
    same(case, [&mut *subject, &mut *reference], camera, kind)?;
    same(case, [subject, reference], Rays::List(&case.rays), kind)
}

/// A camera's rays made on the device answer as the same rays given one by one, whatever the method.
pub(crate) fn camera_is_rays(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let (camera, now) = (&case.camera, case.times[1]);
    let rays: Vec<Ray> = camera.rays().collect();
    let light = case.light;
    for method in methods(subject)? {
        open_with(subject, &case.animation, case.times[0], method).map_err(plainly)?;
        stand(subject, &case.animation, now)?;
        for kind in [
            QueryKind::Closest,
            QueryKind::Any,
            QueryKind::ClosestAndShadow { light },
        ] {
            let given = ask(subject, Rays::List(&rays), kind)?;
            let made = ask(subject, Rays::Camera(camera), kind)?;
            let same = answers(case, now, Rays::Camera(camera), &made, &given);
            same.map_err(|e| format!("{method:?}: {e}"))?;
        }
    }
    Ok(())
}

/// Any-hit says yes exactly where closest-hit finds something, whatever the method.
pub(crate) fn any_is_closest(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    for method in methods(subject)? {
        open_with(subject, &case.animation, case.times[0], method).map_err(plainly)?;
        stand(subject, &case.animation, case.times[1])?;
        let closest = ask(subject, rays, QueryKind::Closest)?.closest;
        let any = ask(subject, rays, QueryKind::Any)?.blocked;
        if closest.len() != any.len() {
            let counts = (closest.len(), any.len());
            return Err(format!("closest and any hits are {counts:?} in number"));
        }
        let mut pairs = closest.iter().zip(&any).enumerate();
        if let Some((i, (c, a))) = pairs.find(|(_, (c, a))| c.is_hit() != (**a == 1)) {
            let ray = named_ray(case, rays, i);
            return Err(format!("closest hit {c:?}, any hit {a}, {method:?}: {ray}"));
        }
    }
    Ok(())
}
