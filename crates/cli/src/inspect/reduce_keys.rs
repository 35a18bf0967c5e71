//! `abvh inspect --reduce-keys`: finds the fewest key frames that represent a motion.

use crate::parsers;
use crate::scene_source::scene_facts;
use crate::stop::Stop;
use crate::table::{KEY_FRAMES, counted, grouped};
use geom::Point;
use scene::Scene;
use scene::keys::{self, Reducer};
use serde::Serialize;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::str::FromStr;

/// Value of `--reduce-keys`: the maximum distance of a vertex from its original position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tolerance {
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

/// The key frames that remain.
#[derive(Serialize)]
pub(super) struct Reduction {
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

pub(super) fn reduce(scene: &Scene, tolerance: Tolerance) -> Result<Reduction, Stop> {
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
pub(super) fn prepare(dir: &Path) -> Result<(), Stop> {
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
pub(super) fn write(dir: &Path, scene: &Scene, reduction: &Reduction) -> Result<(), Stop> {
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

pub(super) fn text(name: &str, r: &Reduction) -> String {
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
    fn parses_tolerances_as_length_or_percentage() {
        assert_eq!("0".parse(), Ok(Tolerance::Units(0.0)));
        assert_eq!("2.5e-3".parse(), Ok(Tolerance::Units(2.5e-3)));
        assert_eq!("1%".parse(), Ok(Tolerance::Share(0.01)));
        for text in ["%", "-1", "-0.1%", "nan", "inf", "inf%", "1%%", "%1"] {
            let why = text.parse::<Tolerance>().unwrap_err();
            assert!(why.contains("0.1%"), "{why}");
        }
    }

    #[test]
    fn empty_bounds_reduce_to_one_key() {
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
        let found = text("", &r);
        assert!(!found.contains("NaN"), "{found}");
    }
}
