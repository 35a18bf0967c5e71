//! `abvh merge`: checks that all shards of a run are complete, and merges their statistics.

use crate::command::RunCommand;
use crate::console;
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::parsers;
use crate::render::statistics;
use clap::Args;
use output::{FileKind, JournalContents, Manifest};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Maximum number of missing frames that the message lists.
const MAX_LISTED: usize = 12;

#[derive(Args, Debug)]
pub(crate) struct MergeSettings {
    /// Output folders of all shards of one run
    #[arg(value_name = "DIR", required = true, value_parser = parsers::file())]
    folders: Vec<PathBuf>,
    /// File for the statistics of all frames, - for standard output
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

impl RunCommand for MergeSettings {
    fn run(&self) -> Result<(), CliError> {
        let folders = self.folders.iter().map(|dir| ("DIR", dir.clone()));
        let files = CommandFiles {
            folders: folders.collect(),
            ..CommandFiles::written(&[("--stats", &self.stats)])
        };
        files.check_apart()?;
        let parts = read(&self.folders)?;
        let mut expected: BTreeMap<u64, BTreeSet<FileKind>> = BTreeMap::new();
        for (&frame, kinds) in parts.iter().flat_map(|part| &part.journals.expected) {
            expected.entry(frame).or_default().extend(kinds);
        }
        if expected.is_empty() {
            return Err(CliError::failed("no run has begun: no folder lists frames"));
        }
        let (mut records, mut missing) = (Vec::new(), Vec::new());
        for (&frame, kinds) in &expected {
            let is_listed = |kind: &FileKind| {
                let mut parts = parts.iter();
                parts.any(|part| part.journals.lists_kind(frame, *kind))
            };
            let listing = parts.iter().filter(|part| part.journals.lists(frame));
            let found = listing.map(|part| part.journals.all_unchanged(frame, part.folder));
            match found.collect::<Option<Vec<_>>>().as_deref() {
                Some([record, ..]) if kinds.iter().all(is_listed) => {
                    records.push((*record).clone());
                }
                _ => missing.push(frame),
            }
        }
        if !missing.is_empty() {
            return Err(CliError::failed(absent(&missing, expected.len())));
        }
        let stats = parts.iter().filter_map(|part| part.journals.stats.as_ref());
        // Prefer statistics that name a device. Those of shards without frames do not.
        let stats = stats.max_by_key(|stats| stats["backend"].is_string());
        if let (Some(file), Some(stats)) = (&self.stats, stats) {
            statistics::write(file, &statistics::with_records(stats.clone(), &records))?;
            if file.as_os_str() == "-" {
                return Ok(());
            }
        }
        console::print(&format!("all {} frames are complete\n", records.len()))
    }
}

/// The results of the shards in one folder.
struct MergedFolder<'a> {
    folder: &'a Path,
    manifest: Manifest,
    journals: JournalContents,
}

impl<'a> MergedFolder<'a> {
    fn read(folder: &'a Path) -> Result<Self, CliError> {
        let name = folder.display();
        let why = if folder.is_dir() {
            "it has no manifest"
        } else {
            "no such directory"
        };
        let no_manifest = || CliError::invalid(format!("{name} holds no run: {why}"));
        let manifest = Manifest::in_folder(folder).map_err(CliError::invalid)?;
        Ok(Self {
            folder,
            manifest: manifest.ok_or_else(no_manifest)?,
            journals: JournalContents::in_folder(folder).map_err(CliError::invalid)?,
        })
    }
}

/// Reads folders, which must belong to one run.
fn read(folders: &[PathBuf]) -> Result<Vec<MergedFolder<'_>>, CliError> {
    let mut all: Vec<MergedFolder<'_>> = Vec::new();
    for folder in folders {
        let part = MergedFolder::read(folder)?;
        if let Some(first) = all.first()
            && let Some(difference) = part.manifest.difference(&first.manifest)
        {
            let [folder, first] = [folder, first.folder].map(Path::display);
            return Err(CliError::invalid(format!(
                "{folder} does not belong to the run in {first}: {difference} (in {first})"
            )));
        }
        all.push(part);
    }
    Ok(all)
}

/// Returns the message about missing frames of a run with `of` frames.
fn absent(missing: &[u64], of: usize) -> String {
    let mut names: Vec<String> = missing
        .iter()
        .take(MAX_LISTED)
        .map(u64::to_string)
        .collect();
    if missing.len() > MAX_LISTED {
        names.push("…".to_owned());
    }
    let (missing, names) = (missing.len(), names.join(", "));
    format!("{missing} of {of} frames are missing, incomplete or damaged: {names}")
}
