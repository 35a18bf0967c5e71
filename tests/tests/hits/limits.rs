//! What a ray hits depends on the ray, the triangles and the intersector alone.

use backend::{Hits, Intersector, QueryKind, Rays};
use conformance::{Target, aimed};
use geom::{Animation, Ray};
use integration::scenes::Source;
use integration::stage::{Stage, camera, light};
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;

const TRACED: [Intersector; 3] = [
    Intersector::Watertight,
    Intersector::Woop,
    Intersector::MollerTrumbore,
];

pub(crate) fn trials(source: Source) -> [Trial; 3] {
    [
        source.trial("threads_do_not_change_hits", threads_do_not_change_hits),
        source.trial("the_tree_does_not_change_hits", |source| {
            for_every_intersector(source, the_tree_does_not_change_hits)
        }),
        source.trial("limits_cut_where_hits_are", |source| {
            for_every_intersector(source, limits_cut_where_hits_are)
        }),
    ]
}

fn for_every_intersector(
    source: Source,
    law: fn(&Arc<Animation>, Intersector) -> Result<(), Failed>,
) -> Result<(), Failed> {
    let animation = source.animation()?;
    for intersector in TRACED {
        law(&animation, intersector)
            .map_err(|e| format!("{intersector}: {}", e.message().unwrap_or("failed")))?;
    }
    Ok(())
}

/// A fresh tree, the first one refitted, and one built at the far end of the motion.
fn the_tree_does_not_change_hits(
    animation: &Arc<Animation>,
    intersector: Intersector,
) -> Result<(), Failed> {
    let camera = camera(animation, [120, 90]);
    let light = light(animation);
    let rays = Rays::Camera(&camera);
    let kind = QueryKind::ClosestAndShadow { light };
    let [mut fresh, mut first, mut last] = [(); 3].map(|()| Stage::new(animation, intersector, 2));
    first.plant(0.0);
    last.plant(animation.end());
    for time in telling_times(animation) {
        fresh.plant(time);
        let expected = fresh.trace(time, rays, kind);
        something_is_hit(&expected)?;
        for (aged, what) in [(&mut first, "first"), (&mut last, "last")] {
            let found = aged.trace(time, rays, kind);
            same(&found, &expected, &format!("{what} tree at {time}"))?;
        }
    }
    Ok(())
}

/// Times that tell: both ends, a key frame, and between key frames.
fn telling_times(animation: &Animation) -> Vec<f64> {
    let end = animation.end();
    let mut times = vec![0.0, (0.37 * end).floor(), 0.618 * end, end];
    times.dedup();
    times
}

fn threads_do_not_change_hits(source: Source) -> Result<(), Failed> {
    let animation = source.animation()?;
    let time = 0.5 * animation.end();
    let rays = hard_rays(&animation, time, 3000);
    let rays = Rays::List(&rays);
    let light = light(&animation);
    let kinds = [
        QueryKind::Closest,
        QueryKind::Any,
        QueryKind::ClosestAndShadow { light },
    ];
    let trace = |threads| {
        let mut stage = Stage::new(&animation, Intersector::Watertight, threads);
        stage.plant(0.0);
        kinds.map(|kind| stage.trace(time, rays, kind))
    };
    let expected = trace(1);
    for threads in [2, 3] {
        for (found, expected) in trace(threads).iter().zip(&expected) {
            same(found, expected, &format!("{threads} threads"))?;
        }
    }
    Ok(())
}

/// Cutting a ray just before its hit makes it miss; just behind it changes
/// nothing, and neither does starting just before; and any-hit agrees.
fn limits_cut_where_hits_are(
    animation: &Arc<Animation>,
    intersector: Intersector,
) -> Result<(), Failed> {
    let time = 0.5 * animation.end();
    let mut stage = Stage::new(animation, intersector, 2);
    stage.plant(time);
    let mut rays = camera(animation, [64, 48]).rays().collect::<Vec<_>>();
    rays.extend(hard_rays(animation, time, 2000));
    let mut trace = |rays: &[Ray], kind| stage.trace(time, Rays::List(rays), kind);
    let hits = trace(&rays, QueryKind::Closest);
    something_is_hit(&hits)?;
    let met: Vec<u8> = hits.closest.iter().map(|h| u8::from(h.is_hit())).collect();
    if trace(&rays, QueryKind::Any).blocked != met {
        return Err("any-hit disagrees with closest-hit".into());
    }
    let cut = |change: fn(&mut Ray, f32)| -> Vec<Ray> {
        let cut = |(ray, hit): (&Ray, &geom::Hit)| {
            let mut ray = *ray;
            if hit.is_hit() {
                change(&mut ray, hit.t);
            }
            ray
        };
        rays.iter().zip(&hits.closest).map(cut).collect()
    };
    let before = cut(|ray, t| ray.t_max = t);
    if trace(&before, QueryKind::Closest)
        .closest
        .iter()
        .any(geom::Hit::is_hit)
    {
        return Err("a ray that ends at its closest hit still hits".into());
    }
    let around = cut(|ray, t| (ray.t_min, ray.t_max) = (t.next_down(), t.next_up()));
    same(
        &trace(&around, QueryKind::Closest),
        &hits,
        "limits round the hit",
    )
}

/// Rays aimed at the inside, at edges and at vertices, from near and far.
fn hard_rays(animation: &Arc<Animation>, time: f64, count: usize) -> Vec<Ray> {
    let targets = Target::ALL.into_iter();
    let aims = targets.flat_map(|target| [(target, 1.5), (target, 30.0)]);
    aims.flat_map(|(target, distance)| aimed(animation, time, target, distance, count / 6))
        .collect()
}

fn something_is_hit(hits: &Hits) -> Result<(), Failed> {
    let count = hits.closest.iter().filter(|h| h.is_hit()).count();
    if count * 50 < hits.closest.len() {
        return Err(format!("only {count} of {} rays hit", hits.closest.len()).into());
    }
    Ok(())
}

/// Equal bit for bit.
fn same(found: &Hits, expected: &Hits, what: &str) -> Result<(), Failed> {
    let bits = |hits: &Hits, i: usize| {
        let h = hits.closest[i];
        (h.triangle, [h.t, h.u, h.v].map(f32::to_bits))
    };
    let differs = |&i: &usize| bits(found, i) != bits(expected, i);
    if found.closest.len() != expected.closest.len()
        || found.blocked.len() != expected.blocked.len()
    {
        return Err(format!("{what}: other numbers of answers").into());
    }
    if let Some(i) = (0..found.closest.len()).find(differs) {
        let (a, b) = (found.closest[i], expected.closest[i]);
        return Err(format!("{what}: ray {i} hits {a:?}, not {b:?}").into());
    }
    if let Some(i) = (0..found.blocked.len()).find(|&i| found.blocked[i] != expected.blocked[i]) {
        return Err(format!("{what}: ray {i} is blocked: {}", found.blocked[i]).into());
    }
    Ok(())
}
