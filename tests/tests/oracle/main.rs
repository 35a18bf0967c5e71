//! `watertight` against exact arithmetic.

mod soup;
mod verifier;

use backend::{Hits, Intersector, Query, QueryKind, Rays};
use geom::{Animation, Ray};
use integration::rays::{Target, aimed, camera};
use integration::scenes::{DEMOS, REAL, Source};
use integration::stage::Stage;
use libtest_mimic::{Arguments, Failed, Trial};
use rayon::prelude::*;
use std::process::ExitCode;
use std::sync::Arc;
use verifier::{Verdict, Verifier};

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let scenes = DEMOS.into_iter().chain(REAL);
    let mut trials: Vec<_> = scenes.flat_map(trials).collect();
    trials.extend(soup::trials());
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn trials(source: Source) -> [Trial; 2] {
    [
        source.trial("pictures_are_exact_but_for_few_rays_near_edges", pictures),
        source.trial("rays_at_edges_name_a_triangle_of_that_edge", rays_at_edges),
    ]
}

/// How many answers differ from the exact ones, and why they may.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    near_edge: usize,
    near_tie: usize,
}

impl Tally {
    fn differing(self) -> usize {
        self.near_edge + self.near_tie
    }
}

/// Judges every ray; the first that cannot be explained is a failure.
pub(crate) fn tally(verify: &Verifier, rays: &[Ray], hits: &Hits) -> Result<Tally, Failed> {
    let verdicts: Vec<_> = (rays.par_iter().zip(&hits.closest))
        .map(|(ray, hit)| verify.verify(ray, hit))
        .collect();
    let mut tally = Tally::default();
    for verdict in verdicts {
        match verdict {
            Verdict::Same => {}
            Verdict::NearEdge => tally.near_edge += 1,
            Verdict::NearTie => tally.near_tie += 1,
            Verdict::Wrong(reason) => return Err(reason.into()),
        }
    }
    Ok(tally)
}

fn trace(animation: &Arc<Animation>, time: f64, rays: &[Ray]) -> Hits {
    let mut stage = Stage::new(animation, Intersector::Watertight, 2);
    stage.plant(time);
    let (rays, kind) = (Rays::List(rays), QueryKind::Closest);
    stage.trace(time, Query { rays, kind })
}

fn judge_at(animation: &Animation, time: f64) -> Verifier {
    let pose = animation.pose(time);
    let triangles = 0..animation.triangle_count() as u32;
    Verifier::new(triangles.map(|i| animation.corners(pose, i)).collect())
}

/// A camera ray passes near an edge by chance only: a few in a million, so
/// hardly ever two of these 38,400.
fn pictures(source: Source) -> Result<(), Failed> {
    let animation = source.open()?.animation;
    let rays = camera(&animation, [240, 160]).rays().collect::<Vec<_>>();
    for time in [0.0, 0.618 * animation.end()] {
        let hits = trace(&animation, time, &rays);
        let tally = tally(&judge_at(&animation, time), &rays, &hits)?;
        if tally.differing() > 2 {
            return Err(format!("too many differ at {time}: {tally:?}").into());
        }
    }
    Ok(())
}

fn rays_at_edges(source: Source) -> Result<(), Failed> {
    let animation = source.open()?.animation;
    let time = 0.618 * animation.end();
    let verify = judge_at(&animation, time);
    for target in [Target::Inside, Target::Edge, Target::Vertex] {
        for distance in [0.6, 2.0, 100.0, 1e4] {
            let pose = animation.pose(time);
            let rays = aimed(&animation, pose, target, distance, 1500);
            tally(&verify, &rays, &trace(&animation, time, &rays))?;
        }
    }
    Ok(())
}
