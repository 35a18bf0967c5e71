//! Rays by the million at edges and vertices of closed bodies: none may slip through, none may hit twice.
//!
//! From inside a closed body every ray meets it, an odd number of times; from
//! outside it meets it an even number of times. Rays are made by a generator
//! that knows only the seed, the batch and the ray's number, so any of them can
//! be made again alone and all of them in parallel.
//!
//! Crossings that lie at the same `t` cannot be told apart by asking again from
//! behind the first. So they are counted over parts of the body in which no two
//! triangles share a vertex, and summed up.

mod batches;
mod crossings;
#[cfg(test)]
mod tests;

use crate::compare::ray_text;
use crate::generate::bodies::{BODIES, Body};
use crate::stage::{fetch, open, stand, start};
use backend::{Backend, Intersector, Method, QueryKind, Rays, Result};
use batches::{BatchSpec, specs};
use geom::{Hit, Ray};

pub(crate) use batches::SORTS;
pub use batches::{Aim, RayBatch, ray_batches};
pub use crossings::crossings;

/// How far bodies are moved from the origin, if nobody says otherwise.
pub const OFFSETS: [f32; 4] = [0.0, 10.0, 1e3, 1e5];
/// Leaks that are kept in full.
const KEPT: usize = 20;
/// Of a batch's rays, at least so many have their crossings counted, and of more rays than that an eighth.
const COUNTED: usize = 4096;

/// What to ask.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPlan {
    /// Decides bodies and rays.
    pub seed: u64,
    /// Rays in all, shared out among bodies, offsets, aims and sides.
    pub rays: u64,
    /// How far to move the bodies along each axis.
    pub offsets: Vec<f32>,
    /// How rays are traced. `watertight` promises that nothing is found; so does `exact`, whose crossings are not counted.
    pub method: Method,
}

/// What became of all rays of one sort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeakRow {
    /// The body's name.
    pub body: &'static str,
    /// How far it was moved.
    pub offset: f32,
    /// What the rays were aimed at.
    pub aim: Aim,
    /// Whether they began inside the body.
    pub inside: bool,
    /// Rays asked.
    pub rays: u64,
    /// Rays from inside that met nothing.
    pub leaks: u64,
    /// Rays whose crossings were counted.
    pub counted: u64,
    /// Of those, rays with an odd number where it should be even, or the reverse, or hit or missed against their count.
    pub miscounts: u64,
    /// Of those, rays from inside with an even number above zero: an edge was crossed twice (or, of several
    /// crossings of a body that is not convex, one was lost).
    pub doubled: u64,
}

/// All rows, and the first wrong rays in full.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeakReport {
    /// One a body, offset, aim and side.
    pub rows: Vec<LeakRow>,
    /// The first few in words, with all digits.
    pub first: Vec<String>,
}

impl LeakReport {
    /// Rays that are wrong.
    #[must_use]
    pub fn wrong(&self) -> u64 {
        self.rows.iter().map(|r| r.leaks + r.miscounts).sum()
    }
}

/// Asks all that `plan` says; `progress` hears how many rays of it are answered.
///
/// Needs about 100 bytes a ray of one batch, of which there are at most `2^20`.
///
/// # Errors
/// The subject failed.
pub fn run(
    subject: &mut dyn Backend,
    plan: &LeakPlan,
    progress: &mut dyn FnMut(u64),
) -> Result<LeakReport> {
    run_over(subject, plan, BODIES, progress)
}

/// Likewise, with these bodies.
pub(crate) fn run_over(
    subject: &mut dyn Backend,
    plan: &LeakPlan,
    bodies: &[Body],
    progress: &mut dyn FnMut(u64),
) -> Result<LeakReport> {
    let specs = specs(plan, bodies);
    let mut found = LeakReport::default();
    let mut next = specs.first().map(|spec| spec.make(plan.seed));
    let mut done = 0;
    for (i, spec) in specs.iter().enumerate() {
        let Some(made) = next.take() else { break };
        open(subject, &made.animation, 0.0, plan.method)?;
        stand(subject, &made.animation, 0.0)?;
        let ticket = start(subject, Rays::List(&made.rays), QueryKind::Closest)?;
        // While the device traces one batch, the host makes the next.
        next = specs.get(i + 1).map(|spec| spec.make(plan.seed));
        let (hits, _) = fetch(subject, ticket)?;
        let crossings = count(subject, plan.method, &made)?;
        judge((spec, &made), &hits.closest, &crossings, &mut found);
        done += made.rays.len() as u64;
        progress(done);
    }
    Ok(found)
}

/// Crossings of the first rays of a batch. Of `exact` they tell nothing: its triangles are closed, so that
/// a ray through an edge crosses both, and their parity is any.
fn count(subject: &mut dyn Backend, method: Method, made: &RayBatch) -> Result<Vec<u32>> {
    if method.intersector == Intersector::Exact {
        return Ok(Vec::new());
    }
    let counted = made.rays.len().div_ceil(8).max(COUNTED);
    let rays = &made.rays[..counted.min(made.rays.len())];
    crossings(subject, method, &made.animation, rays)
}

/// Adds one batch's answers to what was found.
fn judge(
    (spec, made): (&BatchSpec<'_>, &RayBatch),
    hits: &[Hit],
    crossings: &[u32],
    found: &mut LeakReport,
) {
    let first_row = row_of(spec, found);
    for (i, hit) in hits.iter().enumerate() {
        let (_, inside) = RayBatch::sort(i);
        let row = &mut found.rows[first_row + i % SORTS];
        row.rays += 1;
        let leaks = inside && !hit.is_hit();
        row.leaks += u64::from(leaks);
        let mut what = leaks.then(|| "meets nothing".to_owned());
        if let Some(&count) = crossings.get(i) {
            row.counted += 1;
            let odd = count % 2 == 1;
            row.doubled += u64::from(inside && count > 0 && !odd);
            if odd != inside || (count > 0) != hit.is_hit() {
                row.miscounts += 1;
                let first = if hit.is_hit() { "hits" } else { "misses" };
                what.get_or_insert(format!("{first} and crosses {count} times"));
            }
        }
        if let Some(what) = what.filter(|_| found.first.len() < KEPT) {
            found.first.push(described(spec, i, &made.rays[i], &what));
        }
    }
}

/// A wrong ray, in digits and bits.
fn described(spec: &BatchSpec<'_>, i: usize, ray: &Ray, what: &str) -> String {
    let (aim, inside) = RayBatch::sort(i);
    let side = if inside { "inside" } else { "outside" };
    let bits = |p: &[f32; 3]| p.map(|x| format!("{:08x}", x.to_bits())).join(" ");
    format!(
        "{} moved by {:e}, variant {}: a ray from {side} aimed at {aim} {what}: {}; bits {}, {}",
        spec.body.name,
        spec.offset,
        spec.variant,
        ray_text(ray),
        bits(&ray.origin),
        bits(&ray.direction),
    )
}

/// Where the rows of a batch's body and offset begin; makes them where there are none.
fn row_of(spec: &BatchSpec<'_>, found: &mut LeakReport) -> usize {
    let same =
        |r: &LeakRow| r.body == spec.body.name && r.offset.to_bits() == spec.offset.to_bits();
    if let Some(at) = found.rows.iter().position(same) {
        return at;
    }
    let at = found.rows.len();
    found.rows.extend((0..SORTS).map(|i| {
        let (aim, inside) = RayBatch::sort(i);
        LeakRow {
            body: spec.body.name,
            offset: spec.offset,
            aim,
            inside,
            rays: 0,
            leaks: 0,
            counted: 0,
            miscounts: 0,
            doubled: 0,
        }
    }));
    at
}
