//! `abvh merge`: whether the shards of a run are all there, and their statistics as one.

use crate::args::MergeArgs;
use crate::conflicts::Files;
use crate::journal::Done;
use crate::manifest::Manifest;
use crate::stop::Stop;
use crate::{resume, talk};
use output::FrameStats;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Missing frames that are named.
const NAMED: usize = 12;

/// Merges.
pub(crate) fn run(args: &MergeArgs) -> Result<(), Stop> {
    let beginnings: &[&str] = &["frame_", "hits_", "abvh-run"];
    let folder = |folder: &PathBuf| ("DIR", folder.clone(), beginnings);
    let files = Files {
        written: args
            .stats
            .iter()
            .map(|file| ("--stats", file.clone()))
            .collect(),
        folders: args.folders.iter().map(folder).collect(),
        ..Files::default()
    };
    files.check()?;
    let folders = read(&args.folders)?;
    let list: BTreeSet<u64> = folders
        .iter()
        .flat_map(|(_, done)| &done.list)
        .copied()
        .collect();
    if list.is_empty() {
        return Err(Stop::failed("no run has begun there: no frame is named"));
    }
    let row = |frame: &u64| {
        let mut found = folders
            .iter()
            .map(|(folder, done)| done.all_whole(*frame, folder));
        found.find_map(|row| row.cloned()).ok_or(*frame)
    };
    let (rows, missing): (Vec<_>, Vec<_>) = list.iter().map(row).partition(Result::is_ok);
    let rows: Vec<FrameStats> = rows.into_iter().filter_map(Result::ok).collect();
    let missing: Vec<u64> = missing.into_iter().filter_map(Result::err).collect();
    if !missing.is_empty() {
        return Err(Stop::failed(absent(&missing, list.len())));
    }
    let stats = folders.iter().find_map(|(_, done)| done.stats.clone());
    if let (Some(file), Some(stats)) = (&args.stats, stats) {
        let stats: Value = resume::joined(stats, &rows);
        resume::write_stats(file, &stats)?;
        if file.as_os_str() == "-" {
            return Ok(());
        }
    }
    talk::print(&format!("all {} frames are there, whole\n", rows.len()))
}

/// What folders hold that are of one run.
fn read(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Done)>, Stop> {
    let mut first: Option<(&PathBuf, Manifest)> = None;
    let mut all = Vec::new();
    for folder in folders {
        let Some(manifest) = Manifest::in_folder(folder)? else {
            return Err(Stop::bad(format!(
                "{} holds no run: it has no manifest",
                folder.display()
            )));
        };
        if let Some((other, expected)) = &first
            && let Some(difference) = manifest.difference(expected)
        {
            let [folder, other] = [folder, *other].map(|f| f.display());
            return Err(Stop::bad(format!(
                "{folder} and {other} are not of one run: of the first, {difference} in the second"
            )));
        }
        all.push((folder.clone(), Done::in_folder(folder)?));
        first.get_or_insert((folder, manifest));
    }
    Ok(all)
}

fn absent(missing: &[u64], of: usize) -> String {
    let mut names: Vec<String> = missing.iter().take(NAMED).map(u64::to_string).collect();
    if missing.len() > NAMED {
        names.push("…".to_owned());
    }
    format!(
        "{} of {of} frames are missing or damaged: {}",
        missing.len(),
        names.join(", ")
    )
}
