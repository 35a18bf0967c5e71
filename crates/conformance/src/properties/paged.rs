//! Key frames that are read during playback.

use super::Check;
use crate::compare::{same_lists, same_point};
use crate::stage::{next_positions, vertices};
use anyhow::{Context, Result, ensure};
use geom::Animation;
use std::sync::Arc;

/// Number of key frames.
const KEYS: usize = 24;
/// Number of key frames in memory.
const WINDOW: usize = 8;
/// Number of frames that are played.
const FRAMES: usize = 40;
/// Number of frames in flight when the positions of one are read.
const AHEAD: usize = 2;

/// Tests that positions of paged key frames equal those of key frames in memory, in forward playback and at random
/// times, with frames in flight.
pub(super) fn positions(c: &mut Check<'_>) -> Result<()> {
    let triangles = || c.case.animation.triangles().to_vec();
    // The case's key frames repeated. Each moves the first vertex a little more.
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
    let paged = Animation::paged(Arc::new(source), KEYS, WINDOW, triangles())?;
    let paged = Arc::new(paged);
    let times = times(c.case.random_bits);
    c.subject.load(Arc::clone(&paged), c.intersector)?;
    let mut expected = Vec::new();
    for i in 0..FRAMES + AHEAD {
        if let Some(&time) = times.get(i) {
            paged.look_ahead(times[i..].iter().copied());
            c.subject.interpolate(paged.pose(time))?;
            c.subject.request_positions()?;
            expected.push((c.subject.submit()?, vertices(&held, time)));
        }
        if let Some((ticket, wanted)) = i.checked_sub(AHEAD).map(|i| &expected[i]) {
            let (of, found) = next_positions(c.subject)?;
            ensure!(
                of == *ticket,
                "positions of {of:?} arrived, expected those of {ticket:?}"
            );
            same_lists("vertex", &found, wanted, same_point)
                .with_context(|| format!("{ticket:?}"))?;
        }
    }
    Ok(())
}

/// Returns the times of playback: the first half forward, the others random.
fn times(seed: u64) -> Vec<f64> {
    let (mut rng, end) = (fastrand::Rng::with_seed(seed), (KEYS - 1) as f64);
    let forward = (0..FRAMES / 2).map(|i| end * i as f64 / (FRAMES / 2) as f64);
    let anywhere = (0..FRAMES / 2).map(|_| end * rng.f64());
    forward.chain(anywhere).collect()
}
