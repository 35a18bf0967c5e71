//! Key frames left out: judged by plain loops over the scene's own positions, which share no code with the program's.

use crate::sandbox::{Sandbox, ensure, trial};
use geom::Point;
use integration::scenes::{DEMOS, REAL, Source};
use libtest_mimic::{Failed, Trial};
use scene::keys::{self, Reducer};
use scene::{Options, Scene};
use serde_json::{Value, json};

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![
        trial("reduce::what_cannot_be_is_refused", refused),
        trial("reduce::key_frames_are_not_mixed_with_older_ones", mixed),
    ];
    let scenes = DEMOS.into_iter().chain(REAL);
    trials.extend(scenes.map(|s| s.trial("reduced_key_frames_are_the_fewest", fewest)));
    let scenes = DEMOS.into_iter().chain(REAL);
    trials.extend(scenes.map(|s| s.trial("reduced_key_frames_come_back_bit_for_bit", written)));
    trials
}

/// The largest distance at `frame` if `i` and `j` are kept around it; infinite where a vertex is lost or found.
fn error_at(keys: &[Vec<Point>], [i, frame, j]: [usize; 3]) -> f64 {
    let alpha = ((frame - i) as f64 / (j - i) as f64) as f32;
    let mut worst = 0.0_f64;
    for (v, wanted) in keys[frame].iter().enumerate() {
        let (a, b) = (keys[i][v], keys[j][v]);
        let found = [0, 1, 2].map(|x| a[x] + (b[x] - a[x]) * alpha);
        worst = worst.max(distance(found, *wanted));
    }
    worst
}

fn distance(found: Point, wanted: Point) -> f64 {
    let finite = |p: Point| p[0].is_finite() && p[1].is_finite() && p[2].is_finite();
    match (finite(found), finite(wanted)) {
        (true, true) => {
            let d = [0, 1, 2].map(|x| f64::from(found[x]) - f64::from(wanted[x]));
            (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
        }
        (false, false) => 0.0,
        _ => f64::INFINITY,
    }
}

/// The largest error of every stretch between two frames, by the first and the second.
fn all_errors(keys: &[Vec<Point>]) -> Vec<Vec<f64>> {
    let error = |i: usize, j: usize| {
        let between = (i + 1..j).map(|frame| error_at(keys, [i, frame, j]));
        between.fold(0.0, f64::max)
    };
    let frames = 0..keys.len();
    let row = |i| frames.clone().map(|j| error(i, j)).collect();
    frames.clone().map(row).collect()
}

/// (Key frames, error) of the best answer within `tolerance`: every stretch tried, one frame alone first.
fn best(keys: &[Vec<Point>], errors: &[Vec<f64>], tolerance: f64) -> (usize, f64) {
    let alone = |kept: usize| {
        let pairs = keys
            .iter()
            .flat_map(|key| key.iter().zip(&keys[kept]).map(|(a, b)| distance(*b, *a)));
        pairs.fold(0.0, f64::max)
    };
    let least = (0..keys.len()).map(alone).fold(f64::INFINITY, f64::min);
    if least <= tolerance {
        return (1, least);
    }
    let mut to = vec![(1, 0.0)];
    for j in 1..keys.len() {
        let mut found = (usize::MAX, f64::INFINITY);
        for (&(count, error), row) in to.iter().zip(errors) {
            let through: (usize, f64) = (count + 1, f64::max(error, row[j]));
            if row[j] <= tolerance && through < found {
                found = through;
            }
        }
        to.push(found);
    }
    to[keys.len() - 1]
}

/// Half the room, and less.
fn tolerances(scene: &Scene) -> [f64; 3] {
    let bounds = scene.animation.bounds();
    let room = distance(bounds.max, bounds.min);
    [room * 0.5, room * 0.03, room * 0.003]
}

fn fewest(source: Source) -> Result<(), Failed> {
    let scene = source.open()?;
    let keys = scene.animation.keys();
    let errors = all_errors(keys);
    let mut reducer = Reducer::new(&scene.animation);
    for tolerance in tolerances(&scene) {
        let kept = reducer.fewest(tolerance);
        let said = keys::measure(keys, &kept).max_error;
        let (count, error) = best(keys, &errors, tolerance);
        ensure(
            kept.len() == count && (said - error).abs() <= 1e-12 * error,
            || format!("at {tolerance}: {kept:?}, {said} off, where {count} could be {error} off"),
        )?;
        let ends = kept.first() == Some(&0) && kept.last() == Some(&(keys.len() - 1));
        let pairs = kept.windows(2);
        let played = pairs.map(|w| errors[w[0]][w[1]]).fold(0.0, f64::max);
        ensure(count == 1 || (ends && played == error), || {
            format!("at {tolerance}: {kept:?} is {played} off, not {error}")
        })?;
    }
    Ok(())
}

fn written(source: Source) -> Result<(), Failed> {
    let sandbox = Sandbox::new();
    let scene = source.open()?;
    let [_, tolerance, _] = tolerances(&scene);
    let spec = source.path()?;
    let words = format!("inspect {spec} --reduce-keys {tolerance} --json --reduced-out few");
    let answer: Value = serde_json::from_str(&sandbox.run(&words).succeeds()?.stdout)?;
    let kept = Reducer::new(&scene.animation).fewest(tolerance);
    ensure(answer["kept"] == json!(kept), || answer.to_string())?;
    let times = sandbox.json("few/times.json")?;
    let folder = sandbox.path().join("few");
    let few = scene::open(&folder.to_string_lossy(), &Options::default())?;
    ensure(few.animation.keys().len() == kept.len(), || {
        format!("{} of {kept:?}", few.animation.keys().len())
    })?;
    ensure(few.colours == scene.colours, || "other colours".into())?;
    for (place, &key) in kept.iter().enumerate() {
        let time = times["frames"][place]["time"].as_u64();
        ensure(time == Some(key as u64), || format!("{time:?}, not {key}"))?;
        let pose = |a: &geom::Animation| a.pose(key as f64);
        ensure(pose(&few.animation).key as usize == place, || {
            format!("key frame {place} is not played at {key}")
        })?;
        for t in 0..scene.animation.triangle_count() as u32 {
            let old = scene.animation.corners(pose(&scene.animation), t);
            let new = few.animation.corners(pose(&few.animation), t);
            let bits = |t: geom::Triangle| t.map(|p| p.map(f32::to_bits));
            ensure(bits(old) == bits(new), || {
                format!("triangle {t} of key frame {key}: {old:?} became {new:?}")
            })?;
        }
    }
    ensure(few.animation.end() == scene.animation.end(), || {
        format!("it ends at {}", few.animation.end())
    })?;
    for frame in 0..scene.animation.keys().len() {
        let off = played_off(&scene.animation, &few.animation, frame as f64);
        ensure(off <= tolerance, || {
            format!("played {off} off at {frame}, not within {tolerance}")
        })?;
    }
    Ok(())
}

/// The largest distance of a corner of one animation from that of the other, at the same time.
fn played_off(a: &geom::Animation, b: &geom::Animation, time: f64) -> f64 {
    let corners = |a: &geom::Animation, t| a.corners(a.pose(time), t);
    let off = |t| {
        let pairs = corners(a, t).into_iter().zip(corners(b, t));
        pairs.map(|(p, q)| distance(p, q)).fold(0.0, f64::max)
    };
    (0..a.triangle_count() as u32).map(off).fold(0.0, f64::max)
}

fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    sandbox.write("file", "");
    let run = sandbox.run("inspect demo:twist:200 --reduce-keys 1% --reduced-out file");
    run.fails(2, &["file"])
}

fn mixed(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "inspect demo:twist:200 --reduce-keys 5% --reduced-out few";
    sandbox.run(words).succeeds()?;
    let before = sandbox.files();
    sandbox.run(words).fails(2, &["few", "key_00000.ply"])?;
    ensure(sandbox.files() == before, || {
        format!("{:?}", sandbox.files())
    })
}
