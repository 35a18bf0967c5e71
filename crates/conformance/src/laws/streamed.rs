//! Key frames may be read while they are played.

use super::Check;
use crate::compare::{lists, same_point};
use crate::stage::{next_positions, vertices};
use anyhow::{Context, Result, ensure};
use backend::Ticket;
use geom::{Animation, Point};
use std::collections::VecDeque;
use std::sync::Arc;

/// Key frames that are played, of which so many are kept.
const KEYS: usize = 24;
const WINDOW: usize = 8;
const FRAMES: usize = 40;

/// Positions of a stream are those of key frames that are held, forward and in leaps, while others are under way.
pub(super) fn positions(c: &mut Check<'_>) -> Result<()> {
    let triangles = || c.case.animation.triangles().to_vec();
    // The case's key frames over and over, the first vertex shifted a little more each time.
    let own = c.case.animation.all_keys()?;
    let source = move |key: usize| {
        let mut points = own[key % own.len()].to_vec();
        if let Some(first) = points.first_mut() {
            first[0] += key as f32;
        }
        Ok(points)
    };
    let keys = (0..KEYS).map(&source);
    let held = Animation::new(keys.collect::<Result<_, _>>()?, triangles())?;
    let streamed = Arc::new(Animation::streamed(
        Arc::new(source),
        [KEYS, WINDOW],
        triangles(),
    )?);
    let times = times(c.case.chance);
    c.subject.load(Arc::clone(&streamed), c.method)?;
    let mut expected = VecDeque::new();
    for (i, &time) in times.iter().enumerate() {
        streamed.look_ahead(times[i..].iter().copied());
        c.subject.interpolate(streamed.pose(time))?;
        c.subject.request_positions()?;
        expected.push_back((c.subject.submit()?, vertices(&held, time)));
        if i >= 2 {
            compare(c, &mut expected)?;
        }
    }
    while !expected.is_empty() {
        compare(c, &mut expected)?;
    }
    Ok(())
}

/// Half of them forward, the others anywhere.
fn times(chance: u64) -> Vec<f64> {
    let (mut rng, end) = (fastrand::Rng::with_seed(chance), (KEYS - 1) as f64);
    let forward = (0..FRAMES / 2).map(|i| end * i as f64 / (FRAMES / 2) as f64);
    let forward: Vec<f64> = forward.collect();
    let anywhere = (0..FRAMES / 2).map(|_| end * rng.f64());
    forward.into_iter().chain(anywhere).collect()
}

fn compare(c: &mut Check<'_>, expected: &mut VecDeque<(Ticket, Vec<Point>)>) -> Result<()> {
    let (ticket, wanted) = expected.pop_front().expect("one is under way");
    let (of, found) = next_positions(c.subject)?;
    ensure!(of == ticket, "positions of {of:?} came before {ticket:?}");
    lists("vertex", &found, &wanted, same_point).with_context(|| format!("{ticket:?}"))
}
