//! Key frames may arrive while they are played, and nobody needs to have looked at them.

use super::Check;
use crate::compare::{lists, same_counts, same_hit};
use crate::stage::{ask, open, stand};
use anyhow::{Context, Result, ensure};
use backend::{Backend, FrameReport, Hits, Method, QueryKind, Rays};
use geom::{Animation, Point, Ray};
use std::sync::Arc;

/// What is special about a key frame, and the key frame.
type Case = (&'static str, Vec<Point>);

/// A device finds out by itself how far coordinates reach: rays find what they do where the host has looked before.
pub(super) fn measured(c: &mut Check<'_>) -> Result<()> {
    let first = c.case.animation.first().to_vec();
    if first.len() < 8 {
        return Ok(());
    }
    let frames = frames(&first, c.case.chance);
    let [unseen, seen] = [false, true].map(|looks| {
        let marks = vec![false; first.len()];
        let triangles = c.case.animation.triangles().to_vec();
        let live = Animation::live(first.clone(), &marks, triangles).map(Arc::new)?;
        play(c.subject, (&live, c.method, looks), &frames, &c.case.rays)
    });
    for ((name, found), (_, expected)) in unseen?.into_iter().zip(seen?) {
        same(&found, &expected).with_context(|| name.to_owned())?;
    }
    Ok(())
}

fn same(found: &[(Hits, FrameReport)], expected: &[(Hits, FrameReport)]) -> Result<()> {
    for ((hits, report), (right, expected)) in found.iter().zip(expected) {
        lists("hit", &hits.closest, &right.closest, same_hit)?;
        ensure!(hits.blocked == right.blocked, "whether rays hit differs");
        same_counts(report, expected)?;
    }
    Ok(())
}

/// What is asked of a key frame.
type Answers = (&'static str, Vec<(Hits, FrameReport)>);

/// Answers to the same queries of each key frame, at which the host looks before or not at all.
fn play(
    subject: &mut dyn Backend,
    (live, method, looks): (&Arc<Animation>, Method, bool),
    frames: &[Case],
    own: &[Ray],
) -> Result<Vec<Answers>> {
    open(subject, live, 0.0, method)?;
    let play = |(name, frame): &Case| {
        let time = live.push(frame.clone())?;
        if looks {
            live.range(live.pose(time));
        }
        stand(subject, live, time)?;
        let some = own.iter().copied().take(RAYS);
        let rays: Vec<Ray> = some.chain(from_the_middle(frame)).collect();
        let rays = Rays::List(&rays);
        let closest = ask(subject, rays, QueryKind::Closest)?;
        let any = ask(subject, rays, QueryKind::Any)?;
        Ok((*name, vec![closest, any]))
    };
    frames.iter().map(play).collect()
}

/// Rays of either kind. In exact arithmetic each takes its time.
const RAYS: usize = 12;

/// Rays to some vertices that start beside the origin, at many distances.
fn from_the_middle(frame: &[Point]) -> impl Iterator<Item = Ray> {
    let ends = frame.iter().cycle().zip(0..RAYS);
    ends.map(|(&to, i)| Ray::new([0.0, (-4.0 * i as f32).exp2(), 0.0], to))
}

/// The size at which one of the vertices is outlying, where all others have size 1.
const OUTLYING: f32 = 65_536.0;
/// Vertices are near the origin below this, where the scene is not scaled.
const NEAR: f32 = 1.0 / 4_294_967_296.0;

/// Key frames on both sides of each bound.
fn frames(first: &[Point], chance: u64) -> Vec<Case> {
    let mut rng = fastrand::Rng::with_seed(chance);
    let size = |p: &Point| p.iter().fold(0.0, |m: f32, x| m.max(x.abs()));
    let unit = first.iter().map(|p| match size(p) {
        s if s > 0.0 && s.is_finite() => p.map(|x| x / s),
        _ => [1.0; 3],
    });
    let unit: Vec<Point> = unit.collect();
    let with = |points: &[(usize, Point)]| {
        let mut frame = unit.clone();
        points.iter().for_each(|&(at, p)| frame[at] = p);
        frame
    };
    let near = |x: f32| with(&[0, 1, 2].map(|i| (i, [x, if i == 0 { 0.0 } else { x }, -x])));
    let of_all_sizes = |rng: &mut fastrand::Rng, most: i32| -> Vec<Point> {
        let mut by = || (rng.i32(-most..most) as f32).exp2();
        let scaled = unit.iter().map(|p| {
            let by = by();
            p.map(|x| x * by)
        });
        scaled.collect()
    };
    vec![
        ("as it was", first.to_vec()),
        ("not outlying", with(&[(5, [0.5, -OUTLYING, 0.0])])),
        ("outlying", with(&[(5, [0.5, -OUTLYING.next_up(), 0.0])])),
        ("as it was again", first.to_vec()),
        ("near", near(NEAR.next_down())),
        ("not near", near(NEAR)),
        ("too few near", with(&[(0, [0.0; 3]), (3, [1e-20; 3])])),
        ("all zero", vec![[0.0; 3]; first.len()]),
        ("no number", with(&[(4, [f32::NAN, 3.0e38, 0.0])])),
        ("infinite", with(&[(4, [0.0, f32::INFINITY, 1.0])])),
        ("small sizes", of_all_sizes(&mut rng, 8)),
        ("all sizes", of_all_sizes(&mut rng, 60)),
        ("subnormal", vec![[1e-42, -2e-43, 0.0]; first.len()]),
        ("largest", vec![[f32::MAX, -f32::MAX, 1.0]; first.len()]),
    ]
}
