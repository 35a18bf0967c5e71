//! `abvh merge`: checks that all shards of a run are complete, and merges their statistics.

use crate::command::RunCommand;
use crate::console;
use crate::file_checks::CommandFiles;
use crate::render::statistics::{self, RunPlan};
use crate::stop::Stop;
use clap::Args;
use output::{Finished, Manifest};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Maximum number of missing frames that are named.
const NAMED: usize = 12;

#[derive(Args, Debug)]
pub(crate) struct MergeSettings {
    /// Output folders of all shards of one run. For runs that wrote only --stats, the statistics files
    #[arg(value_name = "DIR|FILE.json", required = true)]
    runs: Vec<PathBuf>,
    /// File for the statistics of all frames, - for standard output
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl RunCommand for MergeSettings {
    fn run(&self) -> Result<(), Stop> {
        self.check_files()?;
        let parts = read(&self.runs)?;
        let lists = parts.iter().flat_map(|part| &part.finished.list);
        let list: BTreeSet<u64> = lists.copied().collect();
        if list.is_empty() {
            return Err(Stop::failed("no run has begun there: no frame is named"));
        }
        let (mut rows, mut missing) = (Vec::new(), Vec::new());
        for &frame in &list {
            let mut parts = parts.iter();
            match parts.find_map(|part| part.finished.all_whole(frame, part.path)) {
                Some(row) => rows.push(row.clone()),
                None => missing.push(frame),
            }
        }
        if !missing.is_empty() {
            return Err(Stop::failed(absent(&missing, list.len())));
        }
        let stats = parts.iter().filter_map(|part| part.finished.stats.as_ref());
        // The statistics of shards without frames name no device.
        let stats = stats.max_by_key(|stats| stats["backend"].is_string());
        if let (Some(file), Some(stats)) = (&self.stats, stats) {
            let mut stats = statistics::with_rows(stats.clone(), &rows);
            if stats["run"].is_object() {
                stats["run"]["list"] = json!(list);
            }
            statistics::write(file, &stats)?;
            if file.as_os_str() == "-" {
                return Ok(());
            }
        }
        console::print(&format!("all {} frames are there, whole\n", rows.len()))
    }
}

impl MergeSettings {
    /// Refuses to write a file that is read.
    fn check_files(&self) -> Result<(), Stop> {
        let runs = self.runs.iter().cloned();
        let (files, folders): (Vec<_>, Vec<_>) = runs.partition(|run| run.is_file());
        let files = CommandFiles {
            read: files.into_iter().map(|file| ("FILE", file)).collect(),
            folders: folders.into_iter().map(|dir| ("DIR", dir)).collect(),
            ..CommandFiles::written(&[("--stats", &self.stats)])
        };
        files.check_apart()
    }
}

/// The results of one or more shards.
struct MergedPart<'a> {
    path: &'a Path,
    manifest: Manifest,
    finished: Finished,
}

impl<'a> MergedPart<'a> {
    /// Reads the statistics of a run that wrote no other files.
    fn of_stats(path: &'a Path) -> Result<Self, Stop> {
        let name = path.display();
        let bytes = host::read(path).map_err(|e| Stop::bad(format!("cannot read {name}: {e}")))?;
        let no_stats = |e| Stop::bad(format!("{name} is no file of statistics: {e}"));
        let mut stats: Map<String, Value> = serde_json::from_slice(&bytes).map_err(no_stats)?;
        let frames = stats.remove("frames").unwrap_or_default();
        let frames = serde_json::from_value(frames).map_err(no_stats)?;
        let plan = stats.get("run").cloned().unwrap_or_default();
        let plan: Option<RunPlan> = serde_json::from_value(plan).map_err(no_stats)?;
        let Some(RunPlan { manifest, list }) = plan else {
            return Err(Stop::bad(format!(
                "{name} is of a run that wrote other files too: name their folders"
            )));
        };
        Ok(Self {
            path,
            manifest,
            finished: Finished::of_stats(list, frames, stats.into()),
        })
    }

    fn of_folder(path: &'a Path) -> Result<Self, Stop> {
        let no_manifest = || {
            let folder = path.display();
            Stop::bad(format!("{folder} holds no run: it has no manifest"))
        };
        let manifest = Manifest::in_folder(path).map_err(Stop::bad)?;
        Ok(Self {
            path,
            manifest: manifest.ok_or_else(no_manifest)?,
            finished: Finished::in_folder(path).map_err(Stop::bad)?,
        })
    }
}

/// Reads folders and files of statistics, which must belong to one run.
fn read(runs: &[PathBuf]) -> Result<Vec<MergedPart<'_>>, Stop> {
    let mut all: Vec<MergedPart<'_>> = Vec::new();
    for run in runs {
        let part = if run.is_file() {
            MergedPart::of_stats(run)?
        } else {
            MergedPart::of_folder(run)?
        };
        if let Some(first) = all.first()
            && let Some(difference) = part.manifest.difference(&first.manifest)
        {
            let [run, first] = [run, first.path].map(Path::display);
            return Err(Stop::bad(format!(
                "{run} and {first} are not of one run: of the first, {difference} in the second"
            )));
        }
        all.push(part);
    }
    Ok(all)
}

/// Returns the message about missing frames of a run with `of` frames.
fn absent(missing: &[u64], of: usize) -> String {
    let mut names: Vec<String> = missing.iter().take(NAMED).map(u64::to_string).collect();
    if missing.len() > NAMED {
        names.push("…".to_owned());
    }
    let (missing, names) = (missing.len(), names.join(", "));
    format!("{missing} of {of} frames are missing or damaged: {names}")
}
