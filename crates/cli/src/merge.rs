//! `abvh merge`: checks that all shards of a run are complete, and merges their statistics.

use crate::args::MergeArgs;
use crate::conflicts::Files;
use crate::stop::Stop;
use crate::{resume, talk};
use output::{Finished, Manifest};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const NAMED: usize = 12;

pub(crate) fn run(args: &MergeArgs) -> Result<(), Stop> {
    let runs = args.runs.iter().cloned();
    let (alone, folders): (Vec<_>, Vec<_>) = runs.partition(|run| run.is_file());
    let files = Files {
        read: alone.into_iter().map(|file| ("FILE", file)).collect(),
        folders: folders.into_iter().map(|dir| ("DIR", dir)).collect(),
        ..Files::written(&[("--stats", &args.stats)])
    };
    files.check_apart()?;
    let folders = read(&args.runs)?;
    let lists = folders.iter().flat_map(|(_, done)| &done.list);
    let list: BTreeSet<u64> = lists.copied().collect();
    if list.is_empty() {
        return Err(Stop::failed("no run has begun there: no frame is named"));
    }
    let (mut rows, mut missing) = (Vec::new(), Vec::new());
    for &frame in &list {
        let mut all = folders.iter();
        match all.find_map(|(folder, done)| done.all_whole(frame, folder)) {
            Some(row) => rows.push(row.clone()),
            None => missing.push(frame),
        }
    }
    if !missing.is_empty() {
        return Err(Stop::failed(absent(&missing, list.len())));
    }
    let heads = folders.iter().filter_map(|(_, done)| done.stats.as_ref());
    // The statistics of shards without frames name no device.
    let stats = heads
        .max_by_key(|stats| stats["backend"].is_string())
        .cloned();
    if let (Some(file), Some(stats)) = (&args.stats, stats) {
        let mut stats: Value = resume::joined(stats, &rows);
        if stats["run"].is_object() {
            stats["run"]["list"] = json!(list);
        }
        resume::write_stats(file, &stats)?;
        if file.as_os_str() == "-" {
            return Ok(());
        }
    }
    talk::print(&format!("all {} frames are there, whole\n", rows.len()))
}

/// Describes a run in the statistics of a run that wrote no other files.
#[derive(Deserialize)]
struct Run {
    manifest: Manifest,
    list: Vec<u64>,
}

/// Reads a run that wrote only statistics.
fn read_stats(file: &Path) -> Result<(Manifest, Finished), Stop> {
    let name = file.display();
    let bytes = host::read(file).map_err(|e| Stop::bad(format!("cannot read {name}: {e}")))?;
    let no_stats = |e| Stop::bad(format!("{name} is no file of statistics: {e}"));
    let mut stats: Map<String, Value> = serde_json::from_slice(&bytes).map_err(no_stats)?;
    let frames = stats.remove("frames").unwrap_or_default();
    let frames = serde_json::from_value(frames).map_err(no_stats)?;
    let run = stats.get("run").cloned().unwrap_or_default();
    let run: Option<Run> = serde_json::from_value(run).map_err(no_stats)?;
    let Some(Run { manifest, list }) = run else {
        return Err(Stop::bad(format!(
            "{name} is of a run that wrote other files too: name their folders"
        )));
    };
    Ok((manifest, Finished::of_stats(list, frames, stats.into())))
}

fn read_folder(folder: &Path) -> Result<(Manifest, Finished), Stop> {
    let no_manifest = || {
        let folder = folder.display();
        Stop::bad(format!("{folder} holds no run: it has no manifest"))
    };
    let manifest = Manifest::in_folder(folder).map_err(Stop::bad)?;
    let manifest = manifest.ok_or_else(no_manifest)?;
    Ok((manifest, Finished::in_folder(folder).map_err(Stop::bad)?))
}

/// Reads folders and files of statistics, which must belong to one run.
fn read(runs: &[PathBuf]) -> Result<Vec<(PathBuf, Finished)>, Stop> {
    let mut first: Option<(&PathBuf, Manifest)> = None;
    let mut all = Vec::new();
    for run in runs {
        let (manifest, finished) = match run.is_file() {
            true => read_stats(run)?,
            false => read_folder(run)?,
        };
        let (other, expected) = first.get_or_insert_with(|| (run, manifest.clone()));
        if let Some(difference) = manifest.difference(expected) {
            let [run, other] = [run, *other].map(|f| f.display());
            return Err(Stop::bad(format!(
                "{run} and {other} are not of one run: of the first, {difference} in the second"
            )));
        }
        all.push((run.clone(), finished));
    }
    Ok(all)
}

fn absent(missing: &[u64], of: usize) -> String {
    let mut names: Vec<String> = missing.iter().take(NAMED).map(u64::to_string).collect();
    if missing.len() > NAMED {
        names.push("…".to_owned());
    }
    let (missing, names) = (missing.len(), names.join(", "));
    format!("{missing} of {of} frames are missing or damaged: {names}")
}
