//! Rays by the million at edges and vertices of closed bodies: none may slip through, none may hit twice.
//!
//! From inside a closed body every ray meets it, an odd number of times; from outside an even number of times.
//! Each ray depends on the seed, its batch and its number alone, so that threads need not agree on anything.

use crate::compare::ray_text;
use crate::crossings::crossings;
use crate::generate::bodies::{BODIES, Body, Placed, SORTS};
use crate::generate::{mixed, shares};
use crate::stage::{ask, open, stand};
use backend::{Backend, Intersector, Method, QueryKind, Rays, Result};
use fastrand::Rng;
use geom::{Hit, Ray};
use rayon::prelude::*;

pub use crate::generate::bodies::Aim;

/// How far bodies are moved from the origin, if nobody says otherwise.
pub const OFFSETS: [f32; 4] = [0.0, 10.0, 1e3, 1e5];
/// Leaks that are kept in full.
const KEPT: usize = 20;
/// The most rays of a batch: 32 MiB of them.
const MOST: u64 = 1 << 20;
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

/// Asks all that `plan` says; `progress` hears how many rays of it are answered.
///
/// Needs about 100 bytes a ray of one batch, of which there are at most `2^20`.
pub fn run(
    subject: &mut dyn Backend,
    plan: &LeakPlan,
    progress: &mut dyn FnMut(u64),
) -> Result<LeakReport> {
    run_over(subject, plan, BODIES, progress)
}

/// Likewise, with these bodies. Each at each offset gets as many rays as the next.
pub(crate) fn run_over(
    subject: &mut dyn Backend,
    plan: &LeakPlan,
    bodies: &[Body],
    progress: &mut dyn FnMut(u64),
) -> Result<LeakReport> {
    let offsets = plan.offsets.iter();
    let places = offsets.flat_map(|&offset| bodies.iter().map(move |body| (body, offset)));
    let shares_of_places = shares(plan.rays, (plan.offsets.len() * bodies.len()) as u64);
    let mut found = LeakReport::default();
    let (mut done, mut number) = (0, 0);
    for ((body, offset), share) in places.zip(shares_of_places).filter(|(_, rays)| *rays > 0) {
        let begin = found.rows.len();
        found.rows.extend(rows(body, offset));
        for rays in shares(share, share.div_ceil(MOST)) {
            let seed = mixed(mixed(plan.seed) ^ number);
            let (placed, rays) = batch((body, offset), rays, seed);
            fire(subject, plan.method, (&placed, &rays), begin, &mut found)?;
            number += 1;
            done += rays.len() as u64;
            progress(done);
        }
    }
    Ok(found)
}

/// A row a sort, with nothing counted.
fn rows(body: &Body, offset: f32) -> [LeakRow; SORTS.len()] {
    SORTS.map(|(aim, inside)| LeakRow {
        body: body.name,
        offset,
        aim,
        inside,
        rays: 0,
        leaks: 0,
        counted: 0,
        miscounts: 0,
        doubled: 0,
    })
}

/// A body, turned in every second batch, with so many rays at it.
fn batch((body, offset): (&Body, f32), rays: u64, seed: u64) -> (Placed<'_>, Vec<Ray>) {
    let rng = &mut Rng::with_seed(seed);
    let is_turned = rng.bool();
    let placed = Placed::new(body, offset, is_turned, rng);
    let ray = |i: u64| {
        let rng = &mut Rng::with_seed(mixed(seed ^ (i + 1)));
        placed.ray(SORTS[i as usize % SORTS.len()], rng)
    };
    let rays = (0..rays).into_par_iter().map(ray).collect();
    (placed, rays)
}

/// Traces a batch, and adds what came of it to the rows that begin at `begin`.
fn fire(
    subject: &mut dyn Backend,
    method: Method,
    (placed, rays): (&Placed<'_>, &[Ray]),
    begin: usize,
    found: &mut LeakReport,
) -> Result<()> {
    let body = placed.animation();
    open(subject, &body, 0.0, method)?;
    stand(subject, &body, 0.0)?;
    let (hits, _) = ask(subject, Rays::List(rays), QueryKind::Closest)?;
    // Triangles of `exact` are closed: a ray through an edge crosses both, so that parity says nothing.
    let crossings = match method.intersector {
        Intersector::Exact => Vec::new(),
        _ => {
            let counted = rays.len().div_ceil(8).max(COUNTED).min(rays.len());
            crossings(subject, method, &body, &rays[..counted])?
        }
    };
    for (i, hit) in hits.closest.iter().enumerate() {
        let row = &mut found.rows[begin + i % SORTS.len()];
        let wrong = judge(row, hit, crossings.get(i)).filter(|_| found.first.len() < KEPT);
        let text = wrong.map(|what| described(row, &rays[i], &what));
        found.first.extend(text);
    }
    Ok(())
}

/// Adds one ray's answer to its row; says what is wrong with it.
fn judge(row: &mut LeakRow, hit: &Hit, crossings: Option<&u32>) -> Option<String> {
    row.rays += 1;
    let leaks = row.inside && !hit.is_hit();
    row.leaks += u64::from(leaks);
    let mut what = leaks.then(|| "meets nothing".to_owned());
    if let Some(&count) = crossings {
        row.counted += 1;
        let odd = count % 2 == 1;
        row.doubled += u64::from(row.inside && count > 0 && !odd);
        if odd != row.inside || (count > 0) != hit.is_hit() {
            row.miscounts += 1;
            let first = if hit.is_hit() { "hits" } else { "misses" };
            what.get_or_insert(format!("{first} and crosses {count} times"));
        }
    }
    what
}

/// A wrong ray, in digits that read back to the same bits.
fn described(row: &LeakRow, ray: &Ray, what: &str) -> String {
    let side = if row.inside { "inside" } else { "outside" };
    let (body, offset, aim, ray) = (row.body, row.offset, row.aim, ray_text(ray));
    format!("{body} moved by {offset:e}: a ray from {side} aimed at {aim} {what}: {ray}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use cpu_ref::CpuBackend;

    fn ask(bodies: &[Body], rays: u64) -> LeakReport {
        let mut cpu = CpuBackend::new(Some(2)).unwrap();
        let plan = LeakPlan {
            seed: 5,
            rays,
            offsets: OFFSETS.to_vec(),
            method: Method::default(),
        };
        let mut heard = Vec::new();
        let found = run_over(&mut cpu, &plan, bodies, &mut |n| heard.push(n)).unwrap();
        assert_eq!(heard.last(), Some(&rays));
        assert_eq!(found.rows.iter().map(|r| r.rays).sum::<u64>(), rays);
        found
    }

    #[test]
    fn a_body_without_one_triangle_leaks() {
        let torn = Body {
            shape: || {
                let (points, mut triangles) = (BODIES[0].shape)();
                triangles.pop();
                (points, triangles)
            },
            ..BODIES[0]
        };
        let found = ask(&[torn], 60_000);
        // At a vertex, ties always fall to the same side, where there may be no hole.
        let aimed = |r: &&LeakRow| r.inside && r.aim != Aim::Vertex;
        for row in found.rows.iter().filter(aimed) {
            assert!(row.leaks > 0, "{row:?}");
        }
        for inside in [true, false] {
            let rows = found.rows.iter().filter(|r| r.inside == inside);
            assert!(rows.map(|r| r.miscounts).sum::<u64>() > 0);
        }
        assert_eq!(found.first.len(), KEPT);
        let text = &found.first[0];
        let is_full = text.contains("icosphere") && text.contains("origin ");
        assert!(is_full, "{text}");
    }

    #[test]
    fn a_triangle_that_is_there_twice_is_a_double_hit() {
        let doubled = [Body {
            shape: || {
                let (points, mut triangles) = (BODIES[1].shape)();
                triangles.push(triangles[7]);
                (points, triangles)
            },
            ..BODIES[1]
        }];
        let found = ask(&doubled, 60_000);
        assert_eq!(found.rows.iter().map(|r| r.leaks).sum::<u64>(), 0);
        for inside in [true, false] {
            let rows = || found.rows.iter().filter(|r| r.inside == inside);
            assert!(rows().map(|r| r.miscounts).sum::<u64>() > 0);
            let doubled = rows().map(|r| r.doubled).sum::<u64>();
            assert_eq!(doubled > 0, inside);
        }
    }

    #[test]
    fn rays_depend_on_seed_and_number_alone() {
        let place = (&BODIES[3], 10.0);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let first = batch(place, 160, 9).1;
        assert_eq!(first, one.unwrap().install(|| batch(place, 160, 9).1));
        assert_ne!(first, batch(place, 160, 10).1);
    }
}
