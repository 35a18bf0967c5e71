//! Comparison of results, and messages that describe differences.

use crate::Case;
use anyhow::{Result, anyhow, ensure};
use backend::{FrameReport, Hits, Rays};
use geom::{Animation, Hit, Point, Ray};
use std::fmt::Debug;

/// Returns the first difference between two lists, compared by `same`, as an error.
pub(crate) fn same_lists<T: Debug>(
    what: &str,
    subject: &[T],
    reference: &[T],
    same: impl Fn(&T, &T) -> bool,
) -> Result<()> {
    first_difference(what, [subject, reference], same)
        .map_err(|difference| anyhow!(difference.text))
}

/// The first difference between two lists.
struct Difference {
    index: usize,
    text: String,
}

/// Returns the first difference between two lists. Its index is `usize::MAX` if the lengths differ.
fn first_difference<T: Debug>(
    what: &str,
    [subject, reference]: [&[T]; 2],
    same: impl Fn(&T, &T) -> bool,
) -> Result<(), Difference> {
    if subject.len() != reference.len() {
        let (found, expected) = (subject.len(), reference.len());
        return Err(Difference {
            index: usize::MAX,
            text: format!("{what}: found {found} entries, expected {expected}"),
        });
    }
    let pairs = subject.iter().zip(reference).enumerate();
    let mut wrong = pairs.filter(|(_, (s, r))| !same(s, r));
    match wrong.next() {
        None => Ok(()),
        Some((index, (s, r))) => {
            let more = wrong.count();
            let text = format!("{what} {index} is {s:?}, expected {r:?} (and {more} more differ)");
            Err(Difference { index, text })
        }
    }
}

/// Returns whether two points have the same bits, where any NaN equals any other. The payload of a NaN is not
/// specified.
pub(crate) fn same_point(a: &Point, b: &Point) -> bool {
    let same = |(x, y): (&f32, &f32)| x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan());
    a.iter().zip(b).all(same)
}

/// Returns whether two hits have the same triangle and the same bits.
pub(crate) fn same_hit(a: &Hit, b: &Hit) -> bool {
    let bits = |h: &Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    bits(a) == bits(b)
}

/// Checks that two reports have equal counts of inactive triangles, degenerate triangles, hits and blocked rays.
pub(crate) fn same_counts(seen: &FrameReport, expected: &FrameReport) -> Result<()> {
    let counts = |r: &FrameReport| [r.inactive, r.degenerate, r.hits, r.blocked];
    let (found, right) = (counts(seen), counts(expected));
    ensure!(
        found == right,
        "inactive, degenerate, hits, blocked are {found:?}, expected {right:?}"
    );
    Ok(())
}

/// Relative tolerance of tree costs. A backend may compute and add areas in single precision, in any order.
const COST_TOLERANCE: f64 = 1e-4;

/// Compares the costs of trees.
pub(crate) fn same_cost(found: Option<f64>, expected: Option<f64>) -> Result<()> {
    let is_same = match (found, expected) {
        (Some(found), Some(expected)) => (found / expected - 1.0).abs() <= COST_TOLERANCE,
        (found, expected) => found == expected,
    };
    ensure!(is_same, "the cost is {found:?}, expected {expected:?}");
    Ok(())
}

/// Compares the closest hits and the blocked flags of `rays` at `time`.
pub(crate) fn same_results(
    case: &Case,
    time: f64,
    rays: Rays<'_>,
    subject: &Hits,
    reference: &Hits,
) -> Result<()> {
    let closest = [&subject.closest[..], &reference.closest];
    let blocked = [&subject.blocked[..], &reference.blocked];
    first_difference("hit of ray", closest, same_hit)
        .and_then(|()| first_difference("blocked flag of ray", blocked, PartialEq::eq))
        .map_err(|Difference { index, text }| {
            let named = |hits: &Hits| hits.closest.get(index).map_or(u32::MAX, |h| h.triangle);
            let triangles = [named(subject), named(reference)]
                .map(|t| triangle_text(&case.animation, time, t))
                .join(" against ");
            let ray = named_ray(rays, index);
            anyhow!("at time {time:?}: {text}; {ray}; {triangles}")
        })
}

/// Describes ray `i`, with its index or pixel.
pub(crate) fn named_ray(rays: Rays<'_>, i: usize) -> String {
    match rays {
        Rays::List(list) => {
            let text = list.get(i).map(ray_text).unwrap_or_default();
            format!("ray {i}: {text}")
        }
        Rays::Camera(camera) if i < camera.pixels() => {
            let (x, y) = (i as u32 % camera.width, i as u32 / camera.width);
            format!("pixel ({x}, {y}): {}", ray_text(&camera.ray(x, y)))
        }
        Rays::Camera(_) | Rays::OnDevice(_) => String::new(),
    }
}

/// Formats a ray with enough digits to restore the same bits.
pub(crate) fn ray_text(ray: &Ray) -> String {
    let (origin, direction) = (ray.origin, ray.direction);
    let (t_min, t_max) = (ray.t_min, ray.t_max);
    format!("origin {origin:?}, direction {direction:?}, t in ({t_min:?}, {t_max:?})")
}

/// Formats a triangle with its corners at `time`, for messages.
pub(crate) fn triangle_text(animation: &Animation, time: f64, triangle: u32) -> String {
    if triangle as usize >= animation.triangle_count() {
        return "no triangle".to_owned();
    }
    let corners = animation.at(time).unwrap().corners(triangle);
    format!("triangle {triangle} {corners:?}")
}
