//! Streamed key frames, whose coordinates the host need not examine.

use super::Check;
use super::answers::verify;
use crate::Case;
use crate::compare::{same_counts, same_hit, same_lists};
use crate::generate::rays::{TargetTriangles, nth_ray};
use crate::generate::strategies::sample;
use crate::stage::{
    Traced, fetch, interpolate_and_refit, open, preprocess_and_refit, start, trace_and_wait,
    tree_over,
};
use anyhow::{Context, Result, ensure};
use backend::{Generation, Query, QueryKind, Rays, Ticket};
use fastrand::Rng;
use geom::{Animation, Point, PointBuffer, Ray};
use std::sync::Arc;

/// Maximum number of key frames that are pushed.
const PUSHED: usize = 12;
/// Number of rays aimed at the pushed key frames, two of each kind.
const AIMED: u64 = 34;
/// Positions to which a vertex leaps.
const LEAPS: [Point; 6] = [
    [1e30, 0.0, -2.0],
    [f32::MAX, -f32::MAX, f32::MAX],
    [f32::NAN; 3],
    [0.0, f32::NEG_INFINITY, 1.0],
    [0.0, -0.0, 1e-42],
    [-5.0, 3.0, 40.0],
];

/// Tests that streamed key frames give the same hits and counts as an animation that holds them all.
pub(super) fn pushed(c: &mut Check<'_>) -> Result<()> {
    let rng = &mut Rng::with_seed(c.case.random_bits);
    let (case, streamed) = leaping(c.case, rng)?;
    c.reference.unload();
    let mut c = Check {
        case: &case,
        subject: &mut *c.subject,
        reference: &mut *c.reference,
        intersector: c.intersector,
    };
    for StartedQuery { ticket, time, kind } in push_all(&mut c, &streamed, rng)? {
        let found = fetch(c.subject, ticket)?;
        let rays = Rays::List(&case.rays);
        verify(&mut c, time, Query { rays, kind }, &found)?;
    }
    Ok(())
}

/// Returns a case that repeats the key frames, and a streamed animation with only its first key frame.
///
/// In some key frames one vertex leaps. Some vertices may be fixed.
fn leaping(case: &Case, rng: &mut Rng) -> Result<(Case, Arc<Animation>)> {
    let (own, first) = (case.animation.all_keys()?, case.animation.first());
    let triangles = || case.animation.triangles().to_vec();
    let still = rng.usize(..first.len()) * rng.usize(..2);
    let is_fixed: Vec<bool> = (0..first.len()).map(|v| v < still).collect();
    let streamed = Animation::streamed(first.to_vec(), &is_fixed, triangles())?;
    let mut keys = vec![first.to_vec()];
    for key in 1..=PUSHED {
        let mut frame = own[key % own.len()].to_vec();
        frame[..still].copy_from_slice(&first[..still]);
        if rng.bool() {
            frame[rng.usize(still..first.len())] = LEAPS[rng.usize(..LEAPS.len())];
        }
        // An animation that knows all key frames may choose another scale, in which hits round differently.
        let both = Animation::new(vec![first.to_vec(), frame.clone()], triangles())?;
        if both.scale_exponent() == streamed.scale_exponent() {
            keys.push(frame);
        }
    }
    let times = (0..keys.len()).map(|key| key as f64).collect::<Vec<_>>();
    let animation = Arc::new(Animation::new(keys, triangles())?);
    let targets = times.iter().map(|&t| TargetTriangles::of(&animation, t));
    let targets: Vec<_> = targets.collect();
    let ray = |i| {
        TargetTriangles::pick(
            &targets[i as usize % targets.len()],
            &sample(&nth_ray(i), rng.u64(..)),
        )
    };
    let case = Case {
        rays: (0..AIMED).map(ray).collect(),
        animation,
        times,
        ..case.clone()
    };
    Ok((case, Arc::new(streamed)))
}

/// A query in flight.
struct StartedQuery {
    ticket: Ticket,
    time: f64,
    kind: QueryKind,
}

/// Pushes the case's key frames, in new or reused memory. Adopts trees of random key frames, and starts a query at
/// each key frame.
fn push_all(
    c: &mut Check<'_>,
    streamed: &Arc<Animation>,
    rng: &mut Rng,
) -> Result<Vec<StartedQuery>> {
    let frames = c.case.animation.all_keys()?;
    let (rays, light) = (c.rays(), c.case.light);
    open(c.subject, streamed, 0.0, c.intersector)?;
    interpolate_and_refit(c.subject, streamed, 0.0)?;
    c.subject.submit()?;
    let mut started = Vec::new();
    for (frame, generation) in frames[1..].iter().zip(2..) {
        let mut memory = memory(streamed, rng);
        memory.copy_from_slice(frame);
        let time = streamed.push(memory)?;
        if rng.bool() {
            let tree = tree_over(streamed, &frames[rng.usize(..frames.len())]);
            c.subject.adopt(&tree, Generation(generation))?;
        }
        c.subject.interpolate(streamed.pose(time))?;
        preprocess_and_refit(c.subject)?;
        let kind = [QueryKind::Any, QueryKind::ClosestAndShadow { light }][rng.usize(..2)];
        started.push(StartedQuery {
            ticket: start(c.subject, rays, kind)?,
            time,
            kind,
        });
        let tickets: Vec<_> = started.iter().map(|query| query.ticket).collect();
        c.subject.retain_traces(&tickets);
    }
    Ok(started)
}

/// Returns memory for a key frame: newly allocated, or of a dropped key frame.
fn memory(streamed: &Animation, rng: &mut Rng) -> PointBuffer {
    let spare = streamed.spare_frame().filter(|_| rng.bool());
    spare.unwrap_or_else(|| vec![[0.0; 3]; streamed.vertex_count()].into())
}

/// A key frame with coordinates near a bound of [`geom::CoordinateRange`], or with special values.
struct BoundFrame {
    about: &'static str,
    points: Vec<Point>,
}

/// Tests that a device measures the range of coordinates itself: hits equal those with a range computed on the host.
pub(super) fn measured(c: &mut Check<'_>) -> Result<()> {
    let first = c.case.animation.first().to_vec();
    if first.len() < 8 {
        return Ok(());
    }
    let frames = frames(&first, c.case.random_bits);
    let [unseen, seen] = [false, true].map(|is_known| {
        let is_fixed = vec![false; first.len()];
        let triangles = c.case.animation.triangles().to_vec();
        let streamed = Animation::streamed(first.clone(), &is_fixed, triangles).map(Arc::new)?;
        play(c, &streamed, &frames, is_known)
    });
    for ((found, expected), frame) in unseen?.iter().zip(&seen?).zip(&frames) {
        same(found, expected).context(frame.about)?;
    }
    Ok(())
}

/// Checks that the results of both queries are equal.
fn same(found: &[Traced; 2], expected: &[Traced; 2]) -> Result<()> {
    for (found, expected) in found.iter().zip(expected) {
        let (hits, right) = (&found.hits, &expected.hits);
        same_lists("hit", &hits.closest, &right.closest, same_hit)?;
        ensure!(hits.blocked == right.blocked, "any-hit results differ");
        same_counts(&found.report, &expected.report)?;
    }
    Ok(())
}

/// Returns the results of a closest-hit and an any-hit query at each key frame. Both trace the same rays: rays of the case
/// and rays from near the origin. If `is_known`, the host computes the range of each key frame before the device does.
fn play(
    c: &mut Check<'_>,
    streamed: &Arc<Animation>,
    frames: &[BoundFrame],
    is_known: bool,
) -> Result<Vec<[Traced; 2]>> {
    let subject = &mut *c.subject;
    open(subject, streamed, 0.0, c.intersector)?;
    let play = |frame: &BoundFrame| {
        let time = streamed.push(frame.points.clone())?;
        if is_known {
            streamed.range(streamed.pose(time));
        }
        interpolate_and_refit(subject, streamed, time)?;
        let some = c.case.rays.iter().copied().take(RAYS);
        let rays: Vec<Ray> = some.chain(from_the_middle(&frame.points)).collect();
        let rays = Rays::List(&rays);
        let closest = trace_and_wait(subject, rays, QueryKind::Closest)?;
        Ok([closest, trace_and_wait(subject, rays, QueryKind::Any)?])
    };
    frames.iter().map(play).collect()
}

/// Number of rays in each of two sets: rays of the case, and rays from near the origin. It is small, because exact
/// arithmetic is slow.
const RAYS: usize = 12;

/// Returns rays that start at distances of 1 to `2^-44` from the origin. Their directions are the positions of vertices.
fn from_the_middle(frame: &[Point]) -> impl Iterator<Item = Ray> {
    let ends = frame.iter().cycle().zip(0..RAYS);
    ends.map(|(&to, i)| Ray::new([0.0, (-4.0 * i as f32).exp2(), 0.0], to))
}

/// Largest coordinate of a moment that is not extreme, in a scene that is not scaled.
const FAR: f32 = geom::CoordinateRange::FAR;
/// Upper bound of the coordinates of a tiny triangle, in a scene that is not scaled.
const TINY: f32 = 1.0 / 4_294_967_296.0;

/// Returns key frames on both sides of each bound, and key frames with special values.
fn frames(first: &[Point], seed: u64) -> Vec<BoundFrame> {
    let mut rng = Rng::with_seed(seed);
    let size = |p: &Point| p.iter().fold(0.0, |m: f32, x| m.max(x.abs()));
    let unit = |p: &Point| match size(p) {
        s if s > 0.0 && s.is_finite() => p.map(|x| x / s),
        _ => [1.0; 3],
    };
    let unit: Vec<Point> = first.iter().map(unit).collect();
    let with = |points: &[(usize, Point)]| {
        let mut frame = unit.clone();
        points.iter().for_each(|&(at, p)| frame[at] = p);
        frame
    };
    let tiny = |x: f32| with(&[0, 1, 2].map(|i| (i, [x, if i == 0 { 0.0 } else { x }, -x])));
    let mut of_all_sizes = |most: i32| -> Vec<Point> {
        let scaled = |p: &Point| {
            let by = (rng.i32(-most..most) as f32).exp2();
            p.map(|x| x * by)
        };
        unit.iter().map(scaled).collect()
    };
    let all = [
        ("as it was", first.to_vec()),
        ("not extreme", with(&[(5, [0.5, -FAR, 0.0])])),
        ("extreme", with(&[(5, [0.5, -FAR.next_up(), 0.0])])),
        ("as it was again", first.to_vec()),
        ("tiny", tiny(TINY.next_down())),
        ("not tiny", tiny(TINY)),
        (
            "only one tiny vertex that is not zero",
            with(&[(0, [0.0; 3]), (1, [0.0; 3]), (3, [1e-20; 3])]),
        ),
        ("all zero", vec![[0.0; 3]; first.len()]),
        ("no number", with(&[(4, [f32::NAN, 3.0e38, 0.0])])),
        ("infinite", with(&[(4, [0.0, f32::INFINITY, 1.0])])),
        ("small sizes", of_all_sizes(8)),
        ("all sizes", of_all_sizes(60)),
        ("subnormal", vec![[1e-42, -2e-43, 0.0]; first.len()]),
        ("largest", vec![[f32::MAX, -f32::MAX, 1.0]; first.len()]),
    ];
    let frames = all.into_iter();
    frames
        .map(|(about, points)| BoundFrame { about, points })
        .collect()
}
