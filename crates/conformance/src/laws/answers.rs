//! What rays hit.

use crate::Case;
use crate::compare::answers;
use crate::stage::{ask, open, stand};
use backend::{Backend, Hits, Rays, Seek};

fn at(
    case: &Case,
    backend: &mut dyn Backend,
    rays: Rays<'_>,
    seek: Seek,
) -> Result<Vec<Hits>, String> {
    open(backend, &case.animation, case.times[0])?;
    let mut all = Vec::new();
    for &time in &case.times {
        stand(backend, &case.animation, time)?;
        all.push(ask(backend, rays, seek)?);
    }
    Ok(all)
}

fn same(
    case: &Case,
    [subject, reference]: [&mut dyn Backend; 2],
    rays: Rays<'_>,
    seek: Seek,
) -> Result<(), String> {
    let seen = at(case, subject, rays, seek)?;
    let expected = at(case, reference, rays, seek)?;
    for (i, (s, r)) in seen.iter().zip(&expected).enumerate() {
        answers(s, r).map_err(|e| format!("at time {}: {e}", case.times[i]))?;
    }
    Ok(())
}

/// Triangle, `t`, `u`, `v`: bit for bit.
pub(crate) fn closest(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    same(
        case,
        [subject, reference],
        Rays::List(&case.rays),
        Seek::Closest,
    )
}

/// Whether anything is hit.
pub(crate) fn any(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    same(
        case,
        [subject, reference],
        Rays::List(&case.rays),
        Seek::Any,
    )
}

/// A camera's rays made on the device, with shadows.
pub(crate) fn picture(
    case: &Case,
    subject: &mut dyn Backend,
    reference: &mut dyn Backend,
) -> Result<(), String> {
    let seek = Seek::ClosestAndShadow { light: case.light };
    same(case, [subject, reference], Rays::Camera(&case.camera), seek)
}

/// Any-hit says yes exactly where closest-hit finds something.
pub(crate) fn any_is_closest(
    case: &Case,
    subject: &mut dyn Backend,
    _: &mut dyn Backend,
) -> Result<(), String> {
    let rays = Rays::List(&case.rays);
    open(subject, &case.animation, case.times[0])?;
    stand(subject, &case.animation, case.times[1])?;
    let closest = ask(subject, rays, Seek::Closest)?;
    let any = ask(subject, rays, Seek::Any)?;
    let pairs = closest.closest.iter().zip(&any.blocked).enumerate();
    match pairs
        .into_iter()
        .find(|(_, (c, a))| c.is_hit() != (**a == 1))
    {
        None => Ok(()),
        Some((i, (c, a))) => Err(format!("ray {i}: closest hit {c:?}, any hit {a}")),
    }
}
