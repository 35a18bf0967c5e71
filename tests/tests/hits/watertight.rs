//! `watertight` against exact arithmetic.

use crate::verifier::{Verdict, Verifier};
use backend::{Hits, Intersector};
use conformance::{Target, aimed};
use geom::{Animation, Ray};
use integration::scenes::Source;
use integration::share;
use integration::stage::{Stage, pixels};
use libtest_mimic::{Failed, Trial};
use rayon::prelude::*;
use std::sync::Arc;

pub(crate) fn trials(source: Source) -> [Trial; 2] {
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
    pub(crate) fn differing(self) -> usize {
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

pub(crate) fn trace(animation: &Arc<Animation>, time: f64, rays: &[Ray]) -> Hits {
    let mut stage = Stage::new(animation, Intersector::Watertight, 2);
    stage.plant(time);
    stage.closest(time, rays)
}

fn judge_at(animation: &Animation, time: f64) -> Verifier {
    let pose = animation.pose(time);
    let triangles = 0..animation.triangle_count() as u32;
    Verifier::new(triangles.map(|i| animation.corners(pose, i)).collect())
}

/// A camera ray passes near an edge by chance only: a few in a million, so
/// hardly ever two of 38,400.
fn pictures(source: Source) -> Result<(), Failed> {
    let animation = source.animation()?;
    let rays = pixels(&animation);
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
    let animation = source.animation()?;
    let time = 0.618 * animation.end();
    let verify = judge_at(&animation, time);
    for target in Target::ALL {
        for distance in [0.6, 2.0, 100.0, 1e4] {
            let rays = aimed(&animation, time, target, distance, share(1500));
            tally(&verify, &rays, &trace(&animation, time, &rays))?;
        }
    }
    Ok(())
}
