//! When two answers agree, and how to say that they do not.

use backend::Hits;
use geom::{Aabb, Hit, Point};

/// The first place where two lists differ, told by `same`.
pub(crate) fn lists<T: std::fmt::Debug>(
    what: &str,
    subject: &[T],
    reference: &[T],
    same: impl Fn(&T, &T) -> bool,
) -> Result<(), String> {
    if subject.len() != reference.len() {
        return Err(format!(
            "{} {what}, expected {}",
            subject.len(),
            reference.len()
        ));
    }
    let pairs = subject.iter().zip(reference).enumerate();
    let mut wrong = pairs.filter(|(_, (s, r))| !same(s, r));
    match wrong.next() {
        None => Ok(()),
        Some((i, (s, r))) => {
            let more = wrong.count();
            Err(format!(
                "{what} {i} is {s:?}, expected {r:?} (and {more} more differ)"
            ))
        }
    }
}

/// The same bits, but any NaN for a NaN: what a vertex that is not finite looks like is nobody's business.
pub(crate) fn same_point(a: &Point, b: &Point) -> bool {
    a.iter()
        .zip(b)
        .all(|(x, y)| x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()))
}

/// Equal as numbers, as the contract asks of boxes.
pub(crate) fn same_box(a: &Aabb, b: &Aabb) -> bool {
    a == b
}

/// The same triangle and the same bits.
pub(crate) fn same_hit(a: &Hit, b: &Hit) -> bool {
    let bits = |h: &Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    bits(a) == bits(b)
}

/// Both parts of an answer.
pub(crate) fn answers(subject: &Hits, reference: &Hits) -> Result<(), String> {
    lists("hit of ray", &subject.closest, &reference.closest, same_hit)?;
    lists(
        "blocked flag of ray",
        &subject.blocked,
        &reference.blocked,
        |a, b| a == b,
    )
}
