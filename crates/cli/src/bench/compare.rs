//! Compares two files of results: which times changed, and which changes exceed noise.

use crate::console;
use crate::stop::Stop;
use crate::table::{ms, table};
use output::Summary;
use serde_json::Value;
use std::path::Path;

/// Times that are compared: those of whole frames, which `--fail-above` checks, and those of stages.
const WHOLE: [&str; 2] = ["device_ms", "wall_ms"];
const STAGES: &str =
    "interpolate_ms preprocess_ms refit_ms trace_primary_ms trace_shadow_ms build_ms";
/// Fields that identify a run. Files of earlier versions have a layout.
const NAMES: &str = "scene backend update predict intersector layout rays";
/// Number of standard errors above which a change is not noise.
const SIGMAS: f64 = 3.0;
/// Relative change below which a difference counts as noise, since machines drift.
const DRIFT: f64 = 0.02;
/// Standard error of the median of `n` values with normal noise, as a multiple of the median absolute deviation over
/// the square root of `n`.
const ERROR_OF_MEDIAN: f64 = 1.4826 * 1.2533;

struct ComparedRun {
    name: String,
    frames: Vec<Value>,
}

/// One quantity of one run, in both files.
#[derive(Debug)]
struct Change {
    run: String,
    quantity: &'static str,
    old_ms: f64,
    new_ms: f64,
    /// New over old: the median of the ratios of frames if their times are equal, else the ratio of medians.
    ratio: f64,
    /// Largest relative change that noise explains.
    noise: f64,
    beyond_noise: bool,
}

/// Changes, and the runs that only one file contains.
struct Comparison {
    changes: Vec<Change>,
    only_in_old: Vec<String>,
    only_in_new: Vec<String>,
}

/// Compares two files of results. Fails if a whole frame became slower by more than `fail_above` percent.
pub(super) fn run(old: &Path, new: &Path, fail_above: Option<f64>) -> Result<(), Stop> {
    let comparison = compare(old, new)?;
    let files = [old, new].map(|file| file.display().to_string());
    console::print(&text(&files, &comparison))?;
    match fail_above {
        Some(percent) => refuse_slower(&comparison.changes, percent),
        None => Ok(()),
    }
}

fn compare(old_file: &Path, new_file: &Path) -> Result<Comparison, Stop> {
    let (old, mut new) = (read(old_file)?, read(new_file)?);
    let (mut changes, mut only_in_old) = (Vec::new(), Vec::new());
    for before in old {
        let Some(i) = new.iter().position(|r| r.name == before.name) else {
            only_in_old.push(before.name);
            continue;
        };
        let after = new.remove(i);
        let quantities = WHOLE.into_iter().chain(STAGES.split(' '));
        changes.extend(quantities.filter_map(|q| change(&before, &after, q)));
    }
    let only_in_new = new.into_iter().map(|r| r.name).collect();
    Ok(Comparison {
        changes,
        only_in_old,
        only_in_new,
    })
}

fn refuse_slower(changes: &[Change], percent: f64) -> Result<(), Stop> {
    let limit = 1.0 + percent / 100.0;
    let is_slower = |c: &&Change| WHOLE.contains(&c.quantity) && c.beyond_noise && c.ratio > limit;
    let slower = changes.iter().filter(is_slower);
    let slower = slower.map(|c| format!("{} {} {:.3} times", c.run, c.quantity, c.ratio));
    let slower = slower.collect::<Vec<_>>().join("; ");
    if slower.is_empty() {
        return Ok(());
    }
    let why = format!("slower by more than {percent} %: {slower}");
    Err(Stop::failed(why))
}

/// Reads the runs of a file of `bench` or of `render --stats`.
fn read(file: &Path) -> Result<Vec<ComparedRun>, Stop> {
    let at = |e: &dyn std::fmt::Display| Stop::bad(format!("{}: {e}", file.display()));
    let bytes = std::fs::read(file).map_err(|e| at(&e))?;
    let json: Value = serde_json::from_slice(&bytes).map_err(|e| at(&e))?;
    let run = |row: &Value, frames: &str| {
        let frames = row[frames].as_array()?.clone();
        let name = name(row);
        Some(ComparedRun { name, frames })
    };
    match json["rows"].as_array() {
        Some(rows) => {
            let measured = rows.iter().filter(|row| row["error"].is_null());
            let runs: Option<Vec<_>> = measured.map(|row| run(row, "per_frame")).collect();
            runs.ok_or_else(|| at(&"a row has no frames"))
        }
        None => {
            let run = run(&json, "frames").map(|run| vec![run]);
            run.ok_or_else(|| at(&"neither results of bench nor statistics of render"))
        }
    }
}

fn name(row: &Value) -> String {
    let word = |key: &str| match &row[key] {
        // The layout of all runs of this version, except those of `cpu-ref`.
        Value::String(s) if key == "layout" && s == "fast" => None,
        Value::String(s) => Some(s.clone()),
        Value::Bool(false) => Some(format!("no {key}")),
        Value::Object(scene) if key == "scene" => Some(scene.get("name")?.as_str()?.to_owned()),
        Value::Object(_) => Some(key.to_owned()),
        _ => None,
    };
    let words: Vec<_> = NAMES.split(' ').filter_map(word).collect();
    words.join(" ")
}

/// Returns the change of one quantity, or `None` if a file lacks it.
fn change(old: &ComparedRun, new: &ComparedRun, quantity: &'static str) -> Option<Change> {
    let (a, b) = (series(old, quantity), series(new, quantity));
    let values = |s: &[(f64, f64)]| s.iter().map(|p| p.1).collect::<Vec<_>>();
    let (old_values, new_values) = (values(&a), values(&b));
    let [old_ms, new_ms] = [median(&old_values)?, median(&new_values)?];
    let paired = a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a.0 == b.0);
    let (log, error) = if paired {
        let logs: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (b.1 / a.1).ln()).collect();
        (median(&logs)?, error(&logs)?)
    } else {
        let (x, y) = (error(&old_values)? / old_ms, error(&new_values)? / new_ms);
        ((new_ms / old_ms).ln(), x.hypot(y))
    };
    let noise = DRIFT.max(SIGMAS * error);
    Some(Change {
        run: old.name.clone(),
        quantity,
        old_ms,
        new_ms,
        ratio: log.exp(),
        noise,
        beyond_noise: log.abs() > noise,
    })
}

/// Returns time and value of each frame that has a quantity. Skips the first frame, which builds the first tree.
fn series(run: &ComparedRun, quantity: &str) -> Vec<(f64, f64)> {
    let frames = run.frames.iter().skip(usize::from(run.frames.len() > 1));
    let known = frames.filter_map(|f| Some((f["time"].as_f64()?, f[quantity].as_f64()?)));
    known.filter(|p| p.1 > 0.0).collect()
}

fn median(values: &[f64]) -> Option<f64> {
    Summary::of(values.iter().copied()).map(|s| s.median)
}

fn error(values: &[f64]) -> Option<f64> {
    let middle = median(values)?;
    let off: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    Some(ERROR_OF_MEDIAN * median(&off)? / (values.len() as f64).sqrt())
}

fn text([old, new]: &[String; 2], comparison: &Comparison) -> String {
    let row = |c: &Change| {
        let mark = if !c.beyond_noise {
            ""
        } else if c.ratio < 1.0 {
            "faster"
        } else {
            "SLOWER"
        };
        vec![
            ("run", c.run.clone()),
            ("what", c.quantity.trim_end_matches("_ms").replace('_', " ")),
            ("old ms", ms(c.old_ms)),
            ("new ms", ms(c.new_ms)),
            ("new / old", format!("{:.3}", c.ratio)),
            ("noise", format!("{:.1} %", 100.0 * c.noise)),
            ("", mark.to_owned()),
        ]
    };
    let changes = table(comparison.changes.iter().map(row), 2);
    let mut text = format!("medians of {old} and {new}\n{changes}");
    let only = [
        (old, &comparison.only_in_old),
        (new, &comparison.only_in_new),
    ];
    for (file, runs) in only {
        for run in runs {
            text += &format!("only in {file}: {run}\n");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn frame_variation_does_not_hide_changes() {
        // The load of a frame, with noise that differs between runs.
        let load = |t: f64, seed: f64| (10.0 + t) * (1.0 + 0.01 * (t * seed).sin());
        let run = |count, step, factor, seed| {
            let times = (0..count).map(|i| f64::from(i) * step);
            let frame = |t| json!({ "time": t, "wall_ms": factor * load(t, seed) });
            let (name, frames) = ("a b".to_owned(), times.map(frame).collect());
            ComparedRun { name, frames }
        };
        let old = run(41, 1.0, 1.0, 3.1);
        // If the frames differ, the load hides a change of 5 %, but not a factor of 2.5.
        for (new, beyond_noise) in [
            (run(41, 1.0, 1.05, 7.7), true),
            (run(41, 1.0, 1.0, 5.3), false),
            (run(61, 0.6, 1.05, 7.7), false),
            (run(61, 0.6, 2.5, 7.7), true),
        ] {
            let c = change(&old, &new, "wall_ms").unwrap();
            assert_eq!(c.beyond_noise, beyond_noise, "{c:?}");
            assert!(change(&old, &new, "refit_ms").is_none());
        }
        let slower = change(&old, &run(41, 1.0, 1.05, 7.7), "wall_ms").unwrap();
        assert!((slower.ratio - 1.05).abs() < 0.01, "{slower:?}");
    }

    #[test]
    fn compares_two_result_files() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, json: Value| {
            let path = dir.path().join(name);
            std::fs::write(&path, json.to_string()).unwrap();
            path
        };
        let rows = |update: &str, ms: [f64; 4]| {
            let frame = |(time, ms)| json!({ "time": time, "wall_ms": ms });
            let frames: Vec<Value> = (0..).zip(ms).map(frame).collect();
            json!({ "rows": [{ "scene": "s", "backend": "cpu", "update": update, "per_frame": frames }] })
        };
        let old = file("old.json", rows("refit", [9.0, 1.0, 2.0, 3.0]));
        let new = file("new.json", rows("refit", [9.0, 1.5, 3.0, 4.5]));
        let comparison = compare(&old, &new).unwrap();
        assert!(comparison.changes[0].beyond_noise);
        let files = ["old.json", "new.json"].map(str::to_owned);
        let told = text(&files, &comparison);
        assert!(told.contains("1.500") && told.contains("SLOWER"), "{told}");
        let other = file("other.json", rows("async", [9.0; 4]));
        let told = text(&files, &compare(&old, &other).unwrap());
        for (file, update) in [("old.json", "refit"), ("new.json", "async")] {
            let only = format!("only in {file}: s cpu {update}\n");
            assert!(told.contains(&only), "{told}");
        }
        let mut laid = rows("refit", [9.0, 1.0, 2.0, 3.0]);
        for (layout, runs) in [("fast", 1), ("bvh2", 0)] {
            laid["rows"][0]["layout"] = layout.into();
            let earlier = file("earlier.json", laid.clone());
            let changes = compare(&earlier, &new).unwrap().changes;
            assert_eq!(changes.len(), runs, "{layout}");
        }
        let none = file("else.json", json!({}));
        for (path, says) in [(none, "neither"), (dir.path().join("nowhere"), "nowhere")] {
            let why = compare(&old, &path).err().unwrap();
            assert!(matches!(&why, Stop::Bad(_)) && why.to_string().contains(says));
        }
    }

    #[test]
    fn fails_only_on_slower_wall_time() {
        let change = |quantity, ratio, beyond_noise| Change {
            run: "r".to_owned(),
            quantity,
            old_ms: 1.0,
            new_ms: ratio,
            ratio,
            noise: 0.02,
            beyond_noise,
        };
        let slower = [change("wall_ms", 1.2, true)];
        assert!(refuse_slower(&slower, 25.0).is_ok());
        let why = refuse_slower(&slower, 10.0).unwrap_err();
        let says = "slower by more than 10 %: r wall_ms 1.200";
        assert!(matches!(&why, Stop::Failed(_)) && why.to_string().starts_with(says));
        let fine = [
            change("wall_ms", 1.2, false),
            change("wall_ms", 0.5, true),
            change("refit_ms", 3.0, true),
        ];
        assert!(refuse_slower(&fine, 10.0).is_ok());
    }
}
