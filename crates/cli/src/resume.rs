//! What an earlier run left in the folders of this one, and what is still to be done.

use crate::args::RenderArgs;
use crate::journal::{self, Done, Journal};
use crate::manifest::{self, Manifest};
use crate::outputs::Outputs;
use crate::stop::Stop;
use crate::{frames, record, talk};
use output::{FrameStats, overview};
use pipeline::Frame;
use serde_json::{Value, json};
use std::path::PathBuf;

pub(crate) struct Earlier {
    folders: Vec<(PathBuf, Done)>,
    manifest: Option<Manifest>,
}

impl Earlier {
    /// Looks into the folders of a run, before anything is loaded.
    ///
    /// # Errors
    /// One of them holds another run, and this one is not to overwrite it.
    pub(crate) fn look(args: &RenderArgs, outputs: &Outputs) -> Result<Self, Stop> {
        let (mut folders, mut manifest) = (Vec::new(), None);
        for folder in outputs.folders() {
            let found = match args.overwrite {
                true => None,
                false => Manifest::in_folder(&folder)?,
            };
            if let Some(found) = found {
                let own = Manifest::of(args, found.key_times)?;
                if let Some(difference) = found.difference(&own) {
                    let folder = folder.display();
                    return Err(Stop::bad(format!(
                        "{folder} holds another run: {difference}; --overwrite replaces it"
                    )));
                }
                manifest = Some(found);
            }
            let done = match args.resume && manifest.is_some() {
                true => Done::in_folder(&folder)?,
                false => Done::default(),
            };
            folders.push((folder, done));
        }
        Ok(Self { folders, manifest })
    }

    /// The rows of frames all of whose files are whole, and the other frames.
    pub(crate) fn divide(
        &self,
        frames: Vec<Frame>,
        outputs: &Outputs,
    ) -> (Vec<FrameStats>, Vec<Frame>) {
        let (mut rows, mut rest) = (Vec::new(), Vec::new());
        for frame in frames {
            match self.row(frame.index, outputs) {
                Some(row) => rows.push(row),
                None => rest.push(frame),
            }
        }
        (rows, rest)
    }

    fn row(&self, frame: u64, outputs: &Outputs) -> Option<FrameStats> {
        let mut row = None;
        for (folder, done) in &self.folders {
            for file in outputs.in_folder(frame, folder) {
                let name = file.file_name()?.to_string_lossy().into_owned();
                row = Some(done.whole(frame, folder, &name)?);
            }
        }
        row.cloned()
    }

    /// The rows of all frames, if nothing is left to be done: then nothing needs to be loaded.
    pub(crate) fn finished(
        &self,
        args: &RenderArgs,
        outputs: &Outputs,
    ) -> Result<Option<Vec<FrameStats>>, Stop> {
        let found = self.manifest.as_ref().filter(|_| args.resume);
        let Some(key_times) = found.and_then(|found| found.key_times) else {
            return Ok(None);
        };
        let beside = [&args.timeline, &args.rays_out];
        if beside.into_iter().flatten().any(|file| !file.exists()) {
            return Ok(None);
        }
        let all = frames::list(
            args.frames.as_ref(),
            args.time_range,
            key_times,
            frames::is_demo(&args.scene),
        )?;
        let (rows, rest) = self.divide(frames::of_shard(&all, args.shard), outputs);
        Ok(rest.is_empty().then_some(rows))
    }

    /// Statistics of an earlier run, of these frames.
    pub(crate) fn stats(&self, rows: &[FrameStats]) -> Option<Value> {
        let (_, done) = self.folders.first()?;
        Some(joined(done.stats.clone()?, rows))
    }

    /// Makes the folders say what this run is, and begins a journal in each.
    pub(crate) fn begin(
        self,
        args: &RenderArgs,
        list: &[Frame],
        (key_times, stats): (Option<usize>, &Value),
    ) -> Result<Vec<(PathBuf, Journal)>, Stop> {
        let own = Manifest::of(args, key_times)?;
        let mut journals = Vec::new();
        for (folder, _) in self.folders {
            let found = Manifest::in_folder(&folder).ok().flatten();
            let is_own = found.is_some_and(|found| own.difference(&found).is_none());
            if args.overwrite && !is_own {
                journal::clear(&folder)?;
            }
            // What is there may say more than a shard without frames knows.
            if key_times.is_some() || !is_own {
                output::write_json(&folder.join(manifest::FILE), &own)?;
            }
            let mut journal = Journal::open(&folder, args.shard)?;
            journal.begin(list.iter().map(|f| f.index).collect(), stats.clone())?;
            journals.push((folder, journal));
        }
        Ok(journals)
    }
}

/// Statistics that stand alone: with what `merge` otherwise finds in folders.
pub(crate) fn alone(
    args: &RenderArgs,
    mut stats: Value,
    list: &[Frame],
    key_times: Option<usize>,
) -> Result<Value, Stop> {
    let list: Vec<u64> = list.iter().map(|f| f.index).collect();
    stats["run"] = json!({ "manifest": Manifest::of(args, key_times)?, "list": list });
    Ok(stats)
}

/// Statistics with these rows, in the order of frames.
pub(crate) fn joined(mut stats: Value, rows: &[FrameStats]) -> Value {
    let mut rows = rows.to_vec();
    rows.sort_by_key(|row| row.frame);
    stats["summary"] = json!(overview(&rows));
    stats["frames"] = json!(rows);
    stats["command_line"] = json!(record::command_line());
    stats
}

/// Writes statistics, to standard output for `-`.
pub(crate) fn write_stats(file: &std::path::Path, stats: &Value) -> Result<(), Stop> {
    match file.as_os_str() == "-" {
        true => talk::print_json(stats),
        false => Ok(output::write_json(file, stats)?),
    }
}
