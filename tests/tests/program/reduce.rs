//! Key frames left out: those that are written come back, and all others are played as near as was promised.

use crate::sandbox::{Sandbox, trial};
use geom::{Animation, Point};
use integration::scenes::{DEMOS, REAL, Source};
use libtest_mimic::Trial;
use scene::keys::Reducer;
use serde_json::json;

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials = vec![trial("reduce::what_is_there_is_never_overwritten", refused)];
    for scene in DEMOS.into_iter().chain(REAL) {
        trials.push(scene.trial("reduced_key_frames_come_back_bit_for_bit", written));
    }
    trials
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

fn written(source: Source) {
    let sandbox = Sandbox::new();
    let scene = source.open();
    let (colours, scene) = (&scene.colours, &scene.animation);
    let bounds = scene.bounds();
    let tolerance = 0.03 * distance(bounds.max, bounds.min);
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
        assert!(off <= tolerance, "{off} off at {frame}, not {tolerance}");
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
