//! Millions of rays at edges and vertices of closed bodies. No ray may slip through or hit twice.
//!
//! A ray from inside a closed body crosses it an odd number of times, and a ray from outside an even number. Each ray
//! depends only on the seed, its batch and its number, so that threads need not synchronize.

use crate::compare::ray_text;
use crate::crossings::crossings;
use crate::generate::bodies::{BODIES, ClosedBody, PlacedBody, RaySort};
use crate::generate::{mixed, shares};
use crate::stage::{ask, open, stand};
use backend::{Backend, Intersector, QueryKind, Rays, Result};
use fastrand::Rng;
use geom::{Hit, Ray};
use rayon::prelude::*;

pub use crate::generate::bodies::Aim;

/// Default distances by which bodies are moved from the origin.
pub const OFFSETS: [f32; 4] = [0.0, 10.0, 1e3, 1e5];
/// Maximum number of wrong rays that are described.
const KEPT: usize = 20;
/// Maximum number of rays in a batch: 32 MiB.
const MOST: u64 = 1 << 20;
/// Minimum number of rays per batch whose crossings are counted. In large batches an eighth of the rays are counted.
const COUNTED: usize = 4096;

/// Parameters of a leak test.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPlan {
    /// Seed of the bodies and rays.
    pub seed: u64,
    /// Total number of rays, divided among bodies, offsets, aims and sides.
    pub rays: u64,
    /// Distances by which bodies are moved along each axis.
    pub offsets: Vec<f32>,
    /// Intersector. `watertight` and `exact` must have no leaks. Crossings are not counted with `exact`.
    pub intersector: Intersector,
}

/// Results of all rays of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeakRow {
    /// Name of the body.
    pub body: &'static str,
    /// Distance by which the body was moved.
    pub offset: f32,
    /// Target of the rays.
    pub aim: Aim,
    /// True if the rays start inside the body.
    pub inside: bool,
    /// Number of rays traced.
    pub rays: u64,
    /// Number of rays from inside that miss.
    pub leaks: u64,
    /// Number of rays whose crossings were counted.
    pub counted: u64,
    /// Number of counted rays with the wrong parity, or whose closest hit contradicts the count.
    pub miscounts: u64,
    /// Number of counted rays from inside with an even count above zero.
    ///
    /// An edge was crossed twice, or one of several crossings of a body that is not convex was lost.
    pub doubled: u64,
}

/// Results of a leak test.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeakReport {
    /// One row per body, offset, aim and side.
    pub rows: Vec<LeakRow>,
    /// Descriptions of the first wrong rays, with all digits.
    pub first: Vec<String>,
}

/// Runs a leak test. `progress` receives the number of rays traced so far.
///
/// Requires about 100 bytes per ray of a batch, which has at most `2^20` rays.
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

/// Runs a leak test on `bodies`. Each body at each offset gets the same number of rays, up to one.
pub(crate) fn run_over(
    subject: &mut dyn Backend,
    plan: &LeakPlan,
    bodies: &[ClosedBody],
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
            let batch = LeakBatch::new(body, offset, rays, seed);
            batch.trace(subject, plan.intersector, &mut found, begin)?;
            number += 1;
            done += rays;
            progress(done);
        }
    }
    Ok(found)
}

/// Returns an empty row for each kind of ray.
fn rows(body: &ClosedBody, offset: f32) -> [LeakRow; RaySort::ALL.len()] {
    RaySort::ALL.map(|sort| LeakRow {
        body: body.name,
        offset,
        aim: sort.aim,
        inside: sort.is_inside,
        rays: 0,
        leaks: 0,
        counted: 0,
        miscounts: 0,
        doubled: 0,
    })
}

/// A body, and rays at it.
struct LeakBatch<'a> {
    placed: PlacedBody<'a>,
    rays: Vec<Ray>,
}

impl<'a> LeakBatch<'a> {
    /// Returns a body, which is rotated in half of the batches, and `rays` rays at it.
    fn new(body: &'a ClosedBody, offset: f32, rays: u64, seed: u64) -> Self {
        let rng = &mut Rng::with_seed(seed);
        let is_turned = rng.bool();
        let placed = PlacedBody::new(body, offset, is_turned, rng);
        let ray = |i: u64| {
            let rng = &mut Rng::with_seed(mixed(seed ^ (i + 1)));
            placed.ray(RaySort::ALL[i as usize % RaySort::ALL.len()], rng)
        };
        let rays = (0..rays).into_par_iter().map(ray).collect();
        Self { placed, rays }
    }

    /// Traces the batch, and adds its results to the rows from `begin`.
    fn trace(
        &self,
        subject: &mut dyn Backend,
        intersector: Intersector,
        found: &mut LeakReport,
        begin: usize,
    ) -> Result<()> {
        let (body, rays) = (self.placed.animation(), &self.rays);
        open(subject, &body, 0.0, intersector)?;
        stand(subject, &body, 0.0)?;
        let hits = ask(subject, Rays::List(rays), QueryKind::Closest)?.hits;
        // Triangles of `exact` include their edges. A ray through an edge crosses both triangles, so parity means
        // nothing.
        let crossings = match intersector {
            Intersector::Exact => Vec::new(),
            _ => {
                let counted = rays.len().div_ceil(8).max(COUNTED).min(rays.len());
                crossings(subject, intersector, &body, &rays[..counted])?
            }
        };
        for (i, hit) in hits.closest.iter().enumerate() {
            let row = &mut found.rows[begin + i % RaySort::ALL.len()];
            let wrong = judge(row, hit, crossings.get(i)).filter(|_| found.first.len() < KEPT);
            let text = wrong.map(|what| described(row, &rays[i], &what));
            found.first.extend(text);
        }
        Ok(())
    }
}

/// Adds the result of one ray to its row. Returns a description if the result is wrong.
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

/// Describes a wrong ray, with enough digits to restore the same bits.
fn described(row: &LeakRow, ray: &Ray, what: &str) -> String {
    let side = if row.inside { "inside" } else { "outside" };
    let (body, offset, aim, ray) = (row.body, row.offset, row.aim, ray_text(ray));
    format!("{body} moved by {offset:e}: a ray from {side} aimed at {aim} {what}: {ray}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use cpu_ref::CpuBackend;

    fn ask(bodies: &[ClosedBody], rays: u64) -> LeakReport {
        let mut cpu = CpuBackend::new(Some(2)).unwrap();
        let plan = LeakPlan {
            seed: 5,
            rays,
            offsets: OFFSETS.to_vec(),
            intersector: Intersector::Watertight,
        };
        let mut heard = Vec::new();
        let found = run_over(&mut cpu, &plan, bodies, &mut |n| heard.push(n)).unwrap();
        assert_eq!(heard.last(), Some(&rays));
        assert_eq!(found.rows.iter().map(|r| r.rays).sum::<u64>(), rays);
        found
    }

    #[test]
    fn missing_triangle_causes_leaks() {
        let torn = ClosedBody {
            shape: || {
                let (points, mut triangles) = (BODIES[0].shape)();
                triangles.pop();
                (points, triangles)
            },
            ..BODIES[0]
        };
        let found = ask(&[torn], 60_000);
        // Hits at a vertex always resolve to the same side, where there may be no hole.
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
    fn duplicate_triangle_causes_double_hits() {
        let doubled = [ClosedBody {
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
    fn leak_rays_are_reproducible() {
        let rays = |seed| LeakBatch::new(&BODIES[3], 10.0, 160, seed).rays;
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        assert_eq!(rays(9), one.unwrap().install(|| rays(9)));
        assert_ne!(rays(9), rays(10));
    }
}
