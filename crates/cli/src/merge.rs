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
        let journals = read(&self.folders)?;
        let mut expected: BTreeMap<u64, BTreeSet<FileKind>> = BTreeMap::new();
        for (&frame, kinds) in journals.iter().flat_map(|one| &one.expected) {
            expected.entry(frame).or_default().extend(kinds);
        }
        if expected.is_empty() {
            return Err(CliError::failed("no run has begun: no folder lists frames"));
        }
        let (mut records, mut missing) = (Vec::new(), Vec::new());
        for (&frame, kinds) in &expected {
            let is_listed = |kind: &FileKind| {
                let mut journals = journals.iter();
                journals.any(|one| one.lists_kind(frame, *kind))
            };
            let in_folders = self.folders.iter().zip(&journals);
            let listing = in_folders.filter(|(_, one)| one.lists(frame));
            let found = listing.map(|(folder, one)| one.all_unchanged(frame, folder));
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
        let stats = journals.iter().filter_map(|one| one.stats.as_ref());
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

/// Reads the journals of folders, which must belong to one run.
fn read(folders: &[PathBuf]) -> Result<Vec<JournalContents>, CliError> {
    let manifests = folders.iter().map(|folder| manifest_of(folder));
    let manifests: Vec<_> = manifests.collect::<Result<_, _>>()?;
    for (folder, manifest) in folders.iter().zip(&manifests) {
        if let Some(difference) = manifest.difference(&manifests[0]) {
            let [folder, first] = [folder, &folders[0]].map(|folder| folder.display());
            return Err(CliError::invalid(format!(
                "{folder} does not belong to the run in {first}: {difference} (in {first})"
            )));
        }
    }
    let journals = folders.iter().map(|dir| JournalContents::in_folder(dir));
    let journals = journals.collect::<Result<_, _>>();
    journals.map_err(CliError::invalid)
}

/// Reads the manifest of a folder.
fn manifest_of(folder: &Path) -> Result<Manifest, CliError> {
    let name = folder.display();
    let why = if folder.is_dir() {
        "it has no manifest"
    } else {
        "no such directory"
    };
    let found = Manifest::in_folder(folder).map_err(CliError::invalid)?;
    found.ok_or_else(|| CliError::invalid(format!("{name} holds no run: {why}")))
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
