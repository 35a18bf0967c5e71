//! `abvh inspect`: describes a scene's size and motion, the growth of its refit cost, and the choices of `auto`.
//! `--reduce-keys` finds the fewest key frames that represent the motion.

use crate::camera::CameraSettings;
use crate::command::{Requirement, RunCommand};
use crate::console;
use crate::devices::{BackendName, Opening};
use crate::frame_list;
use crate::parsers;
use crate::scene_source::{self, SceneSettings, is_demo, scene_facts};
use crate::setup;
use crate::stop::Stop;
use crate::table::{KEY_FRAMES, TRIANGLES, counted, grouped, table};
use crate::tracer_settings::{TracerSettings, Workload};
use backend::Intersector;
use clap::Args;
use geom::Point;
use output::Taken;
use pipeline::{Decay, Motion, Spread};
use scene::Scene;
use scene::keys::{self, Reducer};
use serde::Serialize;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Number of times at which the first tree is compared with a fresh one.
const SAMPLES: usize = 5;

#[derive(Args, Debug)]
pub(crate) struct InspectSettings {
    /// Scene: a demo, files or a directory (`abvh render --help` explains names)
    #[arg(value_parser = parsers::scene())]
    scene: String,
    #[command(flatten)]
    source: SceneSettings,
    /// Instead, find the fewest key frames whose blends stay within TOL of every key frame, at every vertex. TOL is in
    /// scene units, or in percent of the diagonal of the scene's bounds
    #[arg(long, value_name = "TOL|TOL%")]
    reduce_keys: Option<Tolerance>,
    /// With --reduce-keys: directory for the key frames as .ply files, and times.json with their times
    #[arg(long, value_name = "DIR", value_parser = parsers::file())]
    reduced_out: Option<PathBuf>,
    /// JSON to standard output
    #[arg(long)]
    json: bool,
}

/// Value of `--reduce-keys`: the maximum distance of a vertex from its original position.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tolerance {
    /// In scene units.
    Units(f64),
    /// As a fraction of the diagonal of the scene's bounds.
    Share(f64),
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const SAYS: &str = "a tolerance is a length from 0 on, such as 0.01, or a share of the diagonal, such as 0.1%";
        let number = parsers::number(|n: f64| n >= 0.0, SAYS);
        match text.strip_suffix('%') {
            Some(share) => Ok(Self::Share(number(share).map_err(|_| SAYS)? / 100.0)),
            None => Ok(Self::Units(number(text).map_err(|_| SAYS)?)),
        }
    }
}

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

impl RunCommand for InspectSettings {
    fn run(&self) -> Result<(), Stop> {
        match self.reduce_keys {
            Some(tolerance) => self.reduce_keys_to(tolerance),
            None => self.inspect(),
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        let mut all = scene_source::requirements(&[&self.scene]);
        all.push(Requirement::new(
            "reduced_out",
            self.reduce_keys.is_some(),
            "goes only with --reduce-keys",
        ));
        all
    }
}

impl InspectSettings {
    fn inspect(&self) -> Result<(), Stop> {
        let scene = self.source.open_to_trace(&self.scene, 0)?;
        setup::check_trees(scene.animation.triangle_count(), 0)?;
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
            auto: choices_of_auto(&self.scene, &scene)?,
        };
        if self.json {
            console::print_json(&inspection)
        } else {
            console::print(&text(&scene, &inspection))
        }
    }

    /// Reduces the key frames, prints the result, and writes the remaining key frames if requested.
    fn reduce_keys_to(&self, tolerance: Tolerance) -> Result<(), Stop> {
        let scene = self.source.open(&self.scene)?;
        if scene.animation.times().is_some() {
            let why =
                "its key frames have been reduced already: reduce those that they are left of";
            return Err(Stop::bad(format!("{}: {why}", self.scene)));
        }
        if let Some(dir) = &self.reduced_out {
            prepare(dir)?;
        }
        let reduction = reduce(&scene, tolerance)?;
        if let Some(dir) = &self.reduced_out {
            write(dir, &scene, &reduction)?;
        }
        if self.json {
            console::print_json(&reduction)
        } else {
            console::print(&reduction_text(&scene.name, &reduction))
        }
    }
}

/// Returns what `render` would choose if everything were `auto`.
fn choices_of_auto(name: &str, scene: &Scene) -> Result<Vec<Taken>, Stop> {
    let animation = &scene.animation;
    let frames = frame_list::list(None, None, animation.whole_times(), is_demo(name))?;
    let settings = TracerSettings::of(BackendName::Auto, Intersector::Watertight, None);
    let workload = Workload {
        frames: &frames,
        rays: CameraSettings::default().pixels(),
    };
    Ok(
        setup::start_driver(animation, &settings, workload, Opening::default())?
            .setup
            .auto,
    )
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
    text += &if bounds.is_empty() {
        "bounds: none, no vertex is finite\n".to_owned()
    } else {
        format!("bounds: {:?} to {:?}\n", bounds.min, bounds.max)
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

#[derive(Serialize)]
struct Reduction {
    scene: Value,
    diagonal: f64,
    tolerance: f64,
    kept: Vec<usize>,
    keys: BeforeAfter,
    bytes: BeforeAfter,
    max_error: f64,
    worst: Option<Value>,
    rms: f64,
}

/// A quantity before and after key frames were removed.
#[derive(Serialize)]
struct BeforeAfter {
    before: usize,
    after: usize,
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
    let key_bytes = animation.vertex_count() * size_of::<Point>();
    Ok(Reduction {
        scene: scene_facts(scene),
        diagonal,
        tolerance,
        kept,
        keys: BeforeAfter { before, after },
        bytes: BeforeAfter {
            before: before * key_bytes,
            after: after * key_bytes,
        },
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
    let mut text = format!(
        "{name}: {} of {} for all of them within {}, {} of the diagonal\n",
        r.keys.after,
        counted(r.keys.before, KEY_FRAMES),
        length(r.tolerance),
        percent(r.tolerance, r.diagonal)
    );
    let kept: Vec<_> = r.kept.iter().map(ToString::to_string).collect();
    text += &format!("kept: {}\n", kept.join(" "));
    let [before, after] = [r.bytes.before, r.bytes.after].map(grouped);
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
    use geom::Animation;

    #[test]
    fn a_tolerance_is_a_length_or_a_share() {
        assert_eq!("0".parse(), Ok(Tolerance::Units(0.0)));
        assert_eq!("2.5e-3".parse(), Ok(Tolerance::Units(2.5e-3)));
        assert_eq!("1%".parse(), Ok(Tolerance::Share(0.01)));
        for text in ["%", "-1", "-0.1%", "nan", "inf", "inf%", "1%%", "%1"] {
            let why = text.parse::<Tolerance>().unwrap_err();
            assert!(why.contains("0.1%"), "{why}");
        }
    }

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
