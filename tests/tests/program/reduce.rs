//! Key frames left out: judged by plain loops over the scene's own positions, which share no code with the program's.

use crate::sandbox::{Sandbox, trial};
use geom::{Animation, KeyFrame, Point};
use integration::scenes::{DEMOS, REAL, Source};
use libtest_mimic::Trial;
use scene::keys::{self, Reducer};
use serde_json::json;

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![trial("reduce::what_is_there_is_never_overwritten", refused)];
    for scene in DEMOS.into_iter().chain(REAL) {
        trials.push(scene.trial("reduced_key_frames_are_the_fewest", fewest));
        trials.push(scene.trial("reduced_key_frames_come_back_bit_for_bit", written));
    }
    trials
}

/// The largest distance at `frame` if `i` and `j` are kept around it; infinite where a vertex is lost or found.
fn error_at(keys: &[KeyFrame], [i, frame, j]: [usize; 3]) -> f64 {
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
fn all_errors(keys: &[KeyFrame]) -> Vec<Vec<f64>> {
    let error = |i: usize, j: usize| {
        let between = (i + 1..j).map(|frame| error_at(keys, [i, frame, j]));
        between.fold(0.0, f64::max)
    };
    let frames = 0..keys.len();
    let row = |i| frames.clone().map(|j| error(i, j)).collect();
    frames.clone().map(row).collect()
}

/// (Key frames, error) of the best answer within `tolerance`: every stretch tried, one frame alone first.
fn best(keys: &[KeyFrame], errors: &[Vec<f64>], tolerance: f64) -> (usize, f64) {
    let alone = |kept: usize| {
        let pairs = keys.iter().flat_map(|key| {
            key.iter()
                .zip(keys[kept].iter())
                .map(|(a, b)| distance(*b, *a))
        });
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
fn tolerances(scene: &Animation) -> [f64; 3] {
    let bounds = scene.bounds();
    let room = distance(bounds.max, bounds.min);
    [room * 0.5, room * 0.03, room * 0.003]
}

fn fewest(source: Source) {
    let scene = source.animation();
    let keys = &scene.all_keys().unwrap()[..];
    let errors = all_errors(keys);
    let mut reducer = Reducer::new(keys);
    for tolerance in tolerances(&scene) {
        let kept = reducer.fewest(tolerance);
        let said = keys::measure(keys, &kept).max_error;
        let (count, error) = best(keys, &errors, tolerance);
        let least = kept.len() == count && (said - error).abs() <= 1e-12 * error;
        assert!(
            least,
            "at {tolerance}: {kept:?}, {said} off, where {count} could be {error} off"
        );
        let ends = kept.first() == Some(&0) && kept.last() == Some(&(keys.len() - 1));
        let pairs = kept.windows(2);
        let played = pairs.map(|w| errors[w[0]][w[1]]).fold(0.0, f64::max);
        let right = count == 1 || (ends && played == error);
        assert!(
            right,
            "at {tolerance}: {kept:?} is {played} off, not {error}"
        );
    }
}

fn written(source: Source) {
    let sandbox = Sandbox::new();
    let scene = source.open();
    let (colours, scene) = (&scene.colours, &scene.animation);
    let tolerance = tolerances(scene)[1];
    let spec = source.path();
    let words = format!("inspect {spec} --reduce-keys {tolerance} --json --reduced-out few");
    let answer = sandbox.run(&words).parsed();
    let kept = Reducer::new(&scene.all_keys().unwrap()).fewest(tolerance);
    assert_eq!(answer["kept"], json!(kept));
    let times = sandbox.json("few/times.json");
    let folder = sandbox.path().join("few");
    let few = scene::open(&folder.to_string_lossy(), &scene::Options::default()).unwrap();
    assert!(few.colours == *colours, "other colours");
    let few = few.animation;
    assert_eq!((few.key_count(), few.end()), (kept.len(), scene.end()));
    for (place, &key) in kept.iter().enumerate() {
        assert_eq!(times["frames"][place]["time"], key);
        assert_eq!(few.pose(key as f64).key as usize, place, "played at {key}");
        for t in 0..scene.triangle_count() as u32 {
            let [old, new] = [scene, &few].map(|a| a.at(key as f64).unwrap().corners(t));
            let bits = |t: geom::Triangle| t.map(|p| p.map(f32::to_bits));
            assert_eq!(bits(old), bits(new), "triangle {t} of key frame {key}");
        }
    }
    for frame in 0..scene.key_count() {
        let off = played_off(scene, &few, frame as f64);
        assert!(
            off <= tolerance,
            "played {off} off at {frame}, not within {tolerance}"
        );
    }
}

/// The largest distance of a corner of one animation from that of the other, at the same time.
fn played_off(a: &Animation, b: &Animation, time: f64) -> f64 {
    let corners = |a: &Animation, t| a.at(time).unwrap().corners(t);
    let off = |t| {
        let pairs = corners(a, t).into_iter().zip(corners(b, t));
        pairs.map(|(p, q)| distance(p, q)).fold(0.0, f64::max)
    };
    (0..a.triangle_count() as u32).map(off).fold(0.0, f64::max)
}

fn refused(sandbox: &Sandbox) {
    sandbox.write("file", "");
    let words = "inspect demo:twist:200 --reduce-keys 5% --reduced-out";
    sandbox.refuses(&format!("{words} file"), &["file"]);
    sandbox.does(&format!("{words} few"));
    let before = sandbox.files();
    sandbox.refuses(&format!("{words} few"), &["few", "key_00000.ply"]);
    assert!(sandbox.files() == before, "{:?}", sandbox.files());
}
