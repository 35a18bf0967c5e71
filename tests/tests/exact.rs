//! `exact` against the oracle, which shares no code with it: every ray, without exception.

use backend::{Hits, Intersector, Query, Rays, Seek};
use conformance::nth_case;
use geom::{Animation, Ray};
use integration::rays::{Target, aimed, camera, of_camera};
use integration::scenes::{DEMOS, REAL, Source};
use integration::stage::Stage;
use libtest_mimic::{Arguments, Failed, Trial};
use oracle::Oracle;
use rayon::prelude::*;
use std::process::ExitCode;
use std::sync::Arc;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let scenes = DEMOS.into_iter().chain(REAL);
    let mut trials: Vec<_> = scenes.flat_map(of_scene).collect();
    trials.extend(
        (0..7).map(|k| Trial::test(format!("odd_scenes_of_kind_{k}"), move || odd_scenes(k))),
    );
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn of_scene(source: Source) -> [Trial; 2] {
    [
        source.trial("every_pixel", pixels),
        source.trial("every_ray_at_an_edge_or_a_vertex", rays_at_edges),
    ]
}

fn pixels(source: Source) -> Result<(), Failed> {
    let animation = source.open()?.animation;
    let rays = of_camera(&camera(&animation, [240, 160]));
    let times = [0.0, 0.618 * animation.end()];
    times
        .iter()
        .try_for_each(|&time| check(&animation, time, &rays))
}

fn rays_at_edges(source: Source) -> Result<(), Failed> {
    let animation = source.open()?.animation;
    let time = 0.618 * animation.end();
    let pose = animation.pose(time);
    for target in [Target::Inside, Target::Edge, Target::Vertex] {
        for distance in [0.6, 100.0, 1e4] {
            let rays = aimed(&animation, pose, target, distance, 400);
            check(&animation, time, &rays)?;
        }
    }
    Ok(())
}

/// Slivers, stacks, far and tiny scenes, with rays along axes, through edges, with limits.
fn odd_scenes(kind: u32) -> Result<(), Failed> {
    for i in 0..40 {
        let case = nth_case(7, kind + 7 * i);
        for &time in &case.times[..2] {
            check(&case.animation, time, &case.rays).map_err(|e| {
                format!("case {}: {}", kind + 7 * i, e.message().unwrap_or_default())
            })?;
        }
    }
    Ok(())
}

/// Closest hits and any hits of all rays, each against the oracle.
fn check(animation: &Arc<Animation>, time: f64, rays: &[Ray]) -> Result<(), Failed> {
    let oracle = Oracle::at(animation, animation.pose(time));
    let mut stage = Stage::new(animation, Intersector::Exact, 2);
    stage.plant(time);
    let mut ask = |seek| {
        stage.trace(
            time,
            Query {
                rays: Rays::List(rays),
                seek,
            },
        )
    };
    let closest: Hits = ask(Seek::Closest);
    let any: Hits = ask(Seek::Any);
    let wrong = (0..rays.len()).into_par_iter().find_first(|&i| {
        let expected = oracle.closest(&rays[i]);
        let found = closest.closest[i];
        found.is_hit() != expected.is_some()
            || expected.is_some_and(|e| e.triangle != found.triangle)
            || (any.blocked[i] == 1) != expected.is_some()
    });
    match wrong {
        None => Ok(()),
        Some(i) => Err(format!(
            "at {time}: ray {i}, {:?}, finds {:?} (any: {}), expected {:?}",
            rays[i],
            closest.closest[i],
            any.blocked[i],
            oracle.closest(&rays[i])
        )
        .into()),
    }
}
