//! Properties of positions and boxes, which precede ray tracing.

use super::Check;
use crate::compare::{lists, same_counts, same_point};
use crate::stage::{boxes_anew, next_positions, tree_at, vertices};
use anyhow::{Context, Result, bail, ensure};
use backend::Generation;
use geom::Animation;
use std::sync::Arc;

/// Tests that interpolated positions equal `geom`'s formula bit for bit.
pub(super) fn positions(c: &mut Check<'_>) -> Result<()> {
    c.open(c.case.times[0])?;
    for &time in &c.case.times {
        c.stand(time)?;
        c.subject.submit()?;
        let seen = c.subject.inspect().positions()?;
        let expected = vertices(&c.case.animation, time);
        lists("position of vertex", &seen, &expected, same_point)
            .with_context(|| format!("at time {time:?}"))?;
    }
    Ok(())
}

/// Tests that requested copies contain the positions of the submissions that requested them, oldest first.
pub(super) fn read_back(c: &mut Check<'_>) -> Result<()> {
    let times = &c.case.times;
    c.open(times[0])?;
    let mut requested = Vec::new();
    // The second time, no boxes are computed from the positions.
    for (&time, made) in times[1..3].iter().zip([true, false]) {
        match made {
            true => c.stand(time)?,
            false => c.interpolate(time)?,
        }
        c.subject.request_positions()?;
        // Commands recorded after the request must not change the copy.
        if made {
            c.interpolate(times[0])?;
        }
        requested.push((c.subject.submit()?, time));
    }
    for &time in times {
        c.stand(time)?;
        c.closest()?;
    }
    for (expected, time) in requested {
        let (ticket, snapshot) = next_positions(c.subject)?;
        let same = ticket == expected;
        ensure!(same, "the copy is of {ticket:?}, expected {expected:?}");
        let formula = vertices(&c.case.animation, time);
        lists("copied vertex", &snapshot, &formula, same_point)
            .with_context(|| format!("at time {time:?}"))?;
    }
    match c.subject.take_positions()? {
        None => Ok(()),
        Some((ticket, _)) => bail!("positions of {ticket:?} came without a request"),
    }
}

/// Commands that may precede the boxes of a moment, which `now` interpolates.
const WAYS: [(&str, &str); 7] = [
    ("nothing came before", "now"),
    ("another moment was interpolated before", "other now"),
    (
        "another moment was preprocessed before",
        "other preprocess now",
    ),
    ("preprocessed again", "now preprocess"),
    ("preprocessed by itself", "other submit now submit"),
    ("positions were requested", "now request"),
    ("a tree came between", "other preprocess now submit adopt"),
];

/// Tests that refitted boxes and counts of triangles equal the reference's for the moment interpolated last, whatever
/// else was recorded.
///
/// A backend may compute boxes from key frames, at the same time as positions or before.
pub(super) fn boxes(c: &mut Check<'_>) -> Result<()> {
    let now = c.case.times[2];
    let expected = c.reference.answer(c.case, (c.method, now), None)?;
    // Three of these per case.
    let begin = c.case.chance as usize % WAYS.len();
    for (about, steps) in WAYS.iter().cycle().skip(begin).take(3) {
        c.open(c.case.times[0])?;
        steps.split(' ').try_for_each(|step| record(c, step))?;
        boxes_anew(c.subject)?;
        let ticket = c.subject.submit()?;
        let report = c.subject.wait(ticket)?;
        let boxes = c.subject.inspect().boxes()?;
        lists("box of node", &boxes, &expected.boxes, PartialEq::eq).context(*about)?;
        same_counts(&report, &expected.report).context(*about)?;
    }
    Ok(())
}

fn record(c: &mut Check<'_>, step: &str) -> backend::Result<()> {
    let times = &c.case.times;
    match step {
        "other" => c.interpolate(times[1]),
        "now" => c.interpolate(times[2]),
        "preprocess" => c.subject.preprocess(),
        "submit" => c.subject.submit().map(drop),
        "request" => c.subject.request_positions(),
        _ => c
            .subject
            .adopt(&tree_at(&c.case.animation, times[0]), Generation(2)),
    }
}

/// Number of key frames, and number kept in memory.
const KEYS: usize = 24;
const WINDOW: usize = 8;
const FRAMES: usize = 40;
/// Number of frames in flight when the positions of one are read.
const AHEAD: usize = 2;

/// Tests that positions of paged key frames equal those of key frames in memory, in forward playback and at random
/// times, with frames in flight.
pub(super) fn paged(c: &mut Check<'_>) -> Result<()> {
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
    let times = times(c.case.chance);
    c.subject.load(Arc::clone(&paged), c.method)?;
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
            ensure!(of == *ticket, "positions of {of:?} came before {ticket:?}");
            lists("vertex", &found, wanted, same_point).with_context(|| format!("{ticket:?}"))?;
        }
    }
    Ok(())
}

/// Returns the times of playback: the first half forward, the others random.
fn times(chance: u64) -> Vec<f64> {
    let (mut rng, end) = (fastrand::Rng::with_seed(chance), (KEYS - 1) as f64);
    let forward = (0..FRAMES / 2).map(|i| end * i as f64 / (FRAMES / 2) as f64);
    let anywhere = (0..FRAMES / 2).map(|_| end * rng.f64());
    forward.chain(anywhere).collect()
}
