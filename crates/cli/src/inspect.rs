//! `abvh inspect`: describes a scene's size and motion, the growth of its refit cost, and the choices of `auto`.
//! `--reduce-keys` finds the fewest key frames that represent the motion.

use crate::args::{InspectArgs, Tolerance};
use crate::bench::FOV;
use crate::choose::Ask;
use crate::stop::Stop;
use crate::table::{KEY_FRAMES, TRIANGLES, counted, grouped, table};
use crate::{frames, session, talk};
use backend::Intersector;
use geom::{Animation, Point};
use output::Taken;
use pipeline::{Decay, Motion, Spread};
use scene::Scene;
use scene::keys::{self, Reducer};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::sync::Arc;

/// Number of times at which the first tree is compared with a fresh one.
const SAMPLES: usize = 5;
/// Default frame size of `render`, in pixels.
const SIZE: [u32; 2] = [1280, 720];

#[derive(Serialize)]
struct Inspection {
    scene: Value,
    bounds: Option<Value>,
    motion: Motion,
    inactive: Spread,
    degenerate: Spread,
    decay: Vec<Decay>,
    auto: Vec<Taken>,
}

pub(crate) fn run(args: &InspectArgs) -> Result<(), Stop> {
    if let Some(tolerance) = args.reduce_keys {
        return run_reduction(args, tolerance);
    }
    let scene = scene::open(&args.scene, &args.source.options_of_run(0))?;
    session::check_trees(scene.animation.triangle_count(), 0)?;
    let animation = &scene.animation;
    let [inactive, degenerate] = pipeline::unhittable(animation).map_err(Stop::bad)?;
    let bounds = animation.bounds();
    let inspection = Inspection {
        scene: scene_facts(&scene),
        bounds: (!bounds.is_empty()).then(|| json!({ "min": bounds.min, "max": bounds.max })),
        motion: pipeline::motion(animation).map_err(Stop::bad)?,
        inactive,
        degenerate,
        decay: pipeline::decay(animation, SAMPLES).map_err(Stop::failed)?,
        auto: what_auto_takes(args, animation)?,
    };
    match args.json {
        true => talk::print_json(&inspection),
        false => talk::print(&text(&scene, &inspection)),
    }
}

/// Returns what `render` would choose if everything were `auto`.
fn what_auto_takes(args: &InspectArgs, animation: &Arc<Animation>) -> Result<Vec<Taken>, Stop> {
    let is_demo = frames::is_demo(&args.scene);
    let frames = frames::list(None, None, animation.whole_times(), is_demo)?;
    let view = shading::frame_scene(animation, FOV, SIZE);
    let camera = view.camera(SIZE);
    let mut ask = Ask::of(None, Intersector::Watertight, None);
    if let Some(camera) = &camera {
        ask = ask.over(&frames, shading::query((camera, view.light)));
    }
    Ok(session::start_driver(animation, &ask)?.1.auto)
}

fn text(scene: &Scene, i: &Inspection) -> String {
    let (animation, m) = (&scene.animation, &i.motion);
    let mut text = format!(
        "{}: {} ({} live, {} moving), {}, {}\n",
        scene.name,
        counted(animation.triangle_count(), TRIANGLES),
        grouped(animation.live_count()),
        grouped(animation.moving_count()),
        counted(animation.vertex_count(), ["vertex", "vertices"]),
        counted(animation.key_count(), KEY_FRAMES)
    );
    let bounds = animation.bounds();
    text += &match bounds.is_empty() {
        false => format!("bounds: {:?} to {:?}\n", bounds.min, bounds.max),
        true => "bounds: none, no vertex is finite\n".to_owned(),
    };
    if let Some(offset) = scene.facts.offset {
        text += &format!("offset: {offset:?} is subtracted from all coordinates\n");
    }
    text += &format!(
        "motion: {:.1}% of the vertices move; a key step is {:.3}% of the diagonal in the mean, {:.3}% at most\n",
        100.0 * m.moving,
        100.0 * m.mean_step,
        100.0 * m.max_step
    );
    for (what, n) in [("inactive", i.inactive), ("degenerate", i.degenerate)] {
        text += &format!("{what}: {} to {} triangles a key frame\n", n.min, n.max);
    }
    text += &decay_table(&i.decay);
    for t in &i.auto {
        text += &format!("{t}\n");
    }
    let notes = scene.facts.notes.iter();
    notes.for_each(|n| text += &format!("note: {n}\n"));
    text
}

fn decay_table(decay: &[Decay]) -> String {
    let row = |d: &Decay| {
        let ratio = d.ratio.map_or("-".to_owned(), |r| format!("{r:.3}"));
        vec![
            ("time", format!("{:.2}", d.time)),
            ("first tree refitted", format!("{:.2}", d.refitted)),
            ("fresh tree", format!("{:.2}", d.fresh)),
            ("SAH ratio", ratio),
        ]
    };
    table(decay.iter().map(row), 0)
}

/// Describes a scene and its source. `live` triangles are active in some key frame. Triangles that never move are
/// interpolated, preprocessed and refitted once.
pub(crate) fn scene_facts(scene: &Scene) -> Value {
    let (animation, facts) = (&scene.animation, &scene.facts);
    json!({
        "name": scene.name,
        "keys": animation.key_count(),
        "vertices": animation.vertex_count(),
        "triangles": animation.triangle_count(),
        "live": animation.live_count(),
        "moving": animation.moving_count(),
        "facts": {
            "format": facts.format,
            "files": facts.files.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>(),
            "clip": facts.clip,
            "seconds_per_key": facts.seconds_per_key,
            "offset": facts.offset,
            "notes": facts.notes,
        },
    })
}

#[derive(Serialize)]
struct Reduction {
    scene: Value,
    diagonal: f64,
    tolerance: f64,
    kept: Vec<usize>,
    #[serde(serialize_with = "before_after")]
    keys: [usize; 2],
    #[serde(serialize_with = "before_after")]
    bytes: [usize; 2],
    max_error: f64,
    worst: Option<Value>,
    rms: f64,
}

fn before_after<S: Serializer>([before, after]: &[usize; 2], to: S) -> Result<S::Ok, S::Error> {
    json!({ "before": before, "after": after }).serialize(to)
}

/// Reduces the key frames, prints the result, and writes the remaining key frames if requested.
fn run_reduction(args: &InspectArgs, tolerance: Tolerance) -> Result<(), Stop> {
    let scene = scene::open(&args.scene, &args.source.options())?;
    if scene.animation.times().is_some() {
        let what = "its key frames have been reduced already: reduce those that they are left of";
        return Err(Stop::bad(format!("{}: {what}", args.scene)));
    }
    if let Some(dir) = &args.reduced_out {
        prepare(dir)?;
    }
    let reduction = reduce(&scene, tolerance)?;
    if let Some(dir) = &args.reduced_out {
        write(dir, &scene, &reduction)?;
    }
    if args.json {
        talk::print_json(&reduction)
    } else {
        talk::print(&reduction_text(&scene.name, &reduction))
    }
}

fn reduce(scene: &Scene, tolerance: Tolerance) -> Result<Reduction, Stop> {
    let animation = &scene.animation;
    let diagonal = animation.bounds().diagonal();
    let tolerance = match tolerance {
        Tolerance::Units(units) => units,
        Tolerance::Share(share) => share * diagonal,
    };
    let all = animation.all_keys().map_err(Stop::bad)?;
    let kept = Reducer::new(&all).fewest(tolerance);
    // Measure the blends against all of the original key frames.
    let fit = keys::measure(&all, &kept);
    if fit.max_error > tolerance {
        let (kept, off) = (counted(kept.len(), KEY_FRAMES), fit.max_error);
        let why = format!("{kept} found for {tolerance}: off by {off}; please report this");
        return Err(Stop::failed(why));
    }
    let [before, after] = [animation.key_count(), kept.len()];
    let bytes = |keys: usize| keys * animation.vertex_count() * size_of::<Point>();
    Ok(Reduction {
        scene: scene_facts(scene),
        diagonal,
        tolerance,
        kept,
        keys: [before, after],
        bytes: [before, after].map(bytes),
        max_error: fit.max_error,
        worst: (fit.worst).map(|(frame, vertex)| json!({ "frame": frame, "vertex": vertex })),
        rms: fit.rms,
    })
}

/// Creates the directory. Refuses one that contains meshes, since they would be read as key frames.
fn prepare(dir: &Path) -> Result<(), Stop> {
    output::prepare_dir(dir).map_err(Stop::bad)?;
    let list = fs::read_dir(dir).map_err(|e| Stop::bad(format!("{}: {e}", dir.display())))?;
    let is_mesh = |path: &Path| {
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        extension.is_some_and(|e| e == "ply" || e == "obj")
    };
    let meshes = list.flatten().filter(|file| is_mesh(&file.path()));
    match meshes.map(|file| file.file_name()).min() {
        Some(file) => Err(Stop::bad(format!(
            "{} has key frames already, such as {}; name an empty directory",
            dir.display(),
            file.display()
        ))),
        None => Ok(()),
    }
}

/// Writes one PLY file per remaining key frame, then the times of all.
fn write(dir: &Path, scene: &Scene, reduction: &Reduction) -> Result<(), Stop> {
    let animation = &scene.animation;
    let mut frames = Vec::new();
    for &key in &reduction.kept {
        let file = format!("key_{key:05}.ply");
        let points = animation.key(key).map_err(Stop::bad)?;
        output::write_with(&dir.join(&file), |out| {
            scene::write_ply(out, &points, animation.triangles(), &scene.colours)
        })?;
        frames.push(json!({ "file": file, "time": key }));
    }
    let times = json!({
        "schema": output::SCHEMA,
        "scene": scene.name,
        "end": animation.end(),
        "seconds_per_key": scene.facts.seconds_per_key,
        "tolerance": reduction.tolerance,
        "max_error": reduction.max_error,
        "frames": frames,
    });
    Ok(output::write_json(&dir.join("times.json"), &times)?)
}

fn reduction_text(name: &str, r: &Reduction) -> String {
    let ([all, few], [before, after]) = (r.keys, r.bytes.map(grouped));
    let mut text = format!(
        "{name}: {few} of {} for all of them within {}, {} of the diagonal\n",
        counted(all, KEY_FRAMES),
        length(r.tolerance),
        percent(r.tolerance, r.diagonal)
    );
    let kept: Vec<_> = r.kept.iter().map(ToString::to_string).collect();
    text += &format!("kept: {}\n", kept.join(" "));
    text += &format!("positions: {before} bytes before, {after} after\n");
    let (max, rms) = (length(r.max_error), length(r.rms));
    text += &format!("error: {max} at most, {}", percent(r.max_error, r.diagonal));
    if let Some(at) = &r.worst {
        text += &format!(", at vertex {} of key frame {}", at["vertex"], at["frame"]);
    }
    text + &format!("; {rms} root mean square\n")
}

fn length(units: f64) -> String {
    match units {
        0.0 => "0".to_owned(),
        units => format!("{units:.3e}"),
    }
}

fn percent(part: f64, whole: f64) -> String {
    let share = if whole > 0.0 { part / whole } else { 0.0 };
    format!("{:.4}%", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_without_size_has_no_diagonal_and_one_key_frame() {
        let animation = Animation::new(vec![vec![[f32::NAN; 3]]; 3], vec![[0; 3]]).unwrap();
        assert_eq!(animation.bounds().diagonal(), 0.0);
        let scene = Scene {
            name: String::new(),
            animation: std::sync::Arc::new(animation),
            colours: [[0; 3]].into(),
            facts: scene::Facts::default(),
        };
        let r = reduce(&scene, Tolerance::Share(0.1)).unwrap();
        assert_eq!((r.kept.as_slice(), r.max_error), ([0].as_slice(), 0.0));
        let text = reduction_text("", &r);
        assert!(!text.contains("NaN"), "{text}");
    }
}
