//! Frames that an earlier run left in the output folders, and the frames that remain.

use crate::args::{RenderArgs, backend_name};
use crate::stop::Stop;
use crate::values::Frames;
use crate::writer::Outputs;
use crate::{frames, info, talk};
use output::{Finished, FrameStats, Journal, Manifest, SCHEMA, SceneId, overview};
use pipeline::Frame;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) struct Earlier {
    folders: Vec<(PathBuf, Finished)>,
    manifest: Option<Manifest>,
}

impl Earlier {
    /// Reads the output folders, before anything is loaded. Fails if a folder contains another run, unless
    /// `--overwrite` is set.
    pub(crate) fn look(args: &RenderArgs, outputs: &Outputs) -> Result<Self, Stop> {
        let (mut folders, mut earlier) = (Vec::new(), None);
        for folder in outputs.folders() {
            let found = match args.overwrite {
                true => None,
                false => Manifest::in_folder(&folder).map_err(Stop::bad)?,
            };
            if let Some(found) = found {
                if let Some(difference) = found.difference(&manifest(args, found.key_times)?) {
                    let other = format!("{} holds another run: {difference}", folder.display());
                    return Err(Stop::bad(format!("{other}; --overwrite replaces it")));
                }
                earlier = Some(found);
            }
            let finished = match args.resume && earlier.is_some() {
                true => Finished::in_folder(&folder).map_err(Stop::bad)?,
                false => Finished::default(),
            };
            folders.push((folder, finished));
        }
        Ok(Self {
            folders,
            manifest: earlier,
        })
    }

    /// Returns the rows of frames whose files are all complete, and the other frames.
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
        for (folder, finished) in &self.folders {
            for file in outputs.in_folder(frame, folder) {
                let name = file.file_name()?.to_string_lossy();
                row = Some(finished.whole(frame, folder, &name)?);
            }
        }
        row.cloned()
    }

    /// Returns the rows of all frames if all are complete, so that nothing needs to be loaded.
    pub(crate) fn finished(
        &self,
        args: &RenderArgs,
        outputs: &Outputs,
    ) -> Result<Option<Vec<FrameStats>>, Stop> {
        let mut beside = [&args.timeline, &args.rays_out].into_iter().flatten();
        let Some(found) = self.manifest.as_ref().filter(|_| args.resume) else {
            return Ok(None);
        };
        if outputs.video.any() || beside.any(|file| !file.exists()) {
            return Ok(None);
        }
        let all = listed(args, found.key_times)?;
        let (rows, rest) = self.divide(frames::of_shard(&all, args.shard), outputs);
        Ok(rest.is_empty().then_some(rows))
    }

    pub(crate) fn stats(&self, rows: &[FrameStats]) -> Option<Value> {
        let (_, finished) = self.folders.first()?;
        Some(joined(finished.stats.clone()?, rows))
    }

    /// Writes the manifest to all folders, and begins a journal in each.
    pub(crate) fn begin(
        self,
        args: &RenderArgs,
        list: &[Frame],
        (own, stats): (&Manifest, &Value),
    ) -> Result<Vec<Journal>, Stop> {
        let shard = args.shard.map(|shard| [shard.number, shard.of]);
        let begin = |(folder, _): (PathBuf, Finished)| {
            let found = Manifest::in_folder(&folder).ok().flatten();
            if args.overwrite && found.as_ref() != Some(own) {
                output::clear_run(&folder).map_err(Stop::bad)?;
            }
            own.write_to(&folder)?;
            let mut journal = Journal::open(&folder, shard).map_err(Stop::bad)?;
            journal.begin(numbers(list), stats.clone())?;
            Ok(journal)
        };
        self.folders.into_iter().map(begin).collect()
    }
}

/// Returns all frames of a run over a motion with `key_times` key times.
pub(crate) fn listed(args: &RenderArgs, key_times: usize) -> Result<Vec<Frame>, Stop> {
    let is_demo = frames::is_demo(&args.scene);
    frames::list(args.frames.as_ref(), args.time_range, key_times, is_demo)
}

pub(crate) fn numbers(list: &[Frame]) -> Vec<u64> {
    list.iter().map(|f| f.index).collect()
}

/// Adds the manifest and the list of frames to the statistics of a run that writes nothing else, for `merge`.
pub(crate) fn alone(
    mut stats: Value,
    outputs: &Outputs,
    (own, all): (&Manifest, &[Frame]),
) -> Value {
    if !outputs.any() {
        stats["run"] = json!({ "manifest": own, "list": numbers(all) });
    }
    stats
}

/// Returns statistics with these rows, in the order of frames.
pub(crate) fn joined(mut stats: Value, rows: &[FrameStats]) -> Value {
    let mut rows = rows.to_vec();
    rows.sort_by_key(|row| row.frame);
    stats["summary"] = json!(overview(&rows));
    stats["frames"] = json!(rows);
    stats["command_line"] = json!(info::command_line());
    stats
}

/// Writes statistics to a file, or to standard output for `-`.
pub(crate) fn write_stats(file: &Path, stats: &Value) -> Result<(), Stop> {
    match file.as_os_str() == "-" {
        true => talk::print_json(stats),
        false => Ok(output::write_json(file, stats)?),
    }
}

/// Returns the manifest of a run over a motion with `key_times` key times.
pub(crate) fn manifest(args: &RenderArgs, key_times: usize) -> Result<Manifest, Stop> {
    let files = scene::files(&args.scene)?;
    // The folder of a file has no effect, but the placement of inputs does.
    let is_placed = args.scene.contains(['+', '@']);
    let name = (files.is_empty() || is_placed).then(|| args.scene.clone());
    let files = output::digests(&files).map_err(Stop::bad)?;
    Ok(Manifest {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: SceneId { name, files },
        key_times,
        options: options(args, key_times),
    })
}

fn options(args: &RenderArgs, key_times: usize) -> BTreeMap<String, Value> {
    // The answers of these are the same whoever gives them and however trees follow.
    let is_robust = args.intersector.is_equal_across_backends();
    let mut all = BTreeMap::from([
        ("size", json!(args.size)),
        ("eye", json!(args.eye)),
        ("look-at", json!(args.look_at)),
        ("up", json!(args.up)),
        ("fov", json!(args.fov)),
        ("light", json!(args.light)),
        ("fps", json!(args.source.fps)),
        ("clip", json!(args.source.clip)),
        // The default view depends on it.
        ("key-memory", json!(args.source.key_memory)),
        ("frames", frames_value(args, key_times)),
        ("intersector", json!(args.intersector.name())),
    ]);
    if args.source.recentre {
        all.insert("recentre", json!(true));
    }
    if !is_robust {
        all.insert("backend", json!(backend_name(args.device.backend)));
        all.insert("adapter", json!(args.device.adapter));
    }
    let owned = |(name, value): (&str, Value)| (name.to_owned(), value);
    all.into_iter().map(owned).collect()
}

/// The times of frames at key times do not depend on other frames. The times of other frames depend on their number.
fn frames_value(args: &RenderArgs, key_times: usize) -> Value {
    if let Some(Frames::Keys(_)) = args.frames {
        return json!("key times");
    }
    let (frames, is_demo) = (args.frames.as_ref(), frames::is_demo(&args.scene));
    let (count, [from, to]) = frames::spread_over(frames, args.time_range, key_times, is_demo);
    json!({ "count": count, "from": from, "to": to })
}
