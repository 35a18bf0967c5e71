//! Frames that an earlier run left in the output folders, and the frames that remain.

use super::RenderSettings;
use super::files::FrameFiles;
use crate::devices::backend_name;
use crate::error::CliError;
use crate::frame_list::{self, EvenFrames, FrameChoice};
use crate::machine::VERSION;
use crate::scene_source::is_demo;
use output::{Journal, JournalContents, Manifest, SCHEMA, SceneId};
use pipeline::{Frame, FrameRecord};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// An earlier run in the output folders.
pub(super) struct EarlierRun {
    folders: Vec<(PathBuf, JournalContents)>,
    manifest: Option<Manifest>,
}

/// The manifest of a run, and the numbers of all its frames in all shards.
pub(super) struct RunPlan {
    pub(super) manifest: Manifest,
    pub(super) list: Vec<u64>,
}

/// Frames that are complete, and the others.
pub(super) struct DividedFrames {
    pub(super) done: Vec<FrameRecord>,
    pub(super) todo: Vec<Frame>,
}

impl EarlierRun {
    /// Reads the output folders, before anything is loaded. Fails if a folder contains another run, unless
    /// `--overwrite` is set.
    pub(super) fn find(settings: &RenderSettings, files: &FrameFiles) -> Result<Self, CliError> {
        let (mut folders, mut earlier) = (Vec::new(), None);
        for folder in files.folders() {
            let found = if settings.overwrite {
                None
            } else {
                Manifest::in_folder(&folder).map_err(CliError::invalid)?
            };
            if let Some(found) = &found {
                check_same_run(&folder, found, &manifest(settings, found.key_frames)?)?;
            }
            let finished = if settings.resume && found.is_some() {
                JournalContents::in_folder(&folder).map_err(CliError::invalid)?
            } else {
                JournalContents::default()
            };
            earlier = found.or(earlier);
            folders.push((folder, finished));
        }
        Ok(Self {
            folders,
            manifest: earlier,
        })
    }

    /// Separates frames whose files are all complete from those to render. With a video, all frames are rendered.
    pub(super) fn divide(&self, frames: Vec<Frame>, files: &FrameFiles) -> DividedFrames {
        let (mut done, mut todo) = (Vec::new(), Vec::new());
        for frame in frames {
            match self.row(frame.index, files).filter(|_| !files.has_video) {
                Some(row) => done.push(row),
                None => todo.push(frame),
            }
        }
        DividedFrames { done, todo }
    }

    fn row(&self, frame: u64, files: &FrameFiles) -> Option<FrameRecord> {
        let mut row = None;
        for (folder, finished) in &self.folders {
            for file in files.in_folder(frame, folder) {
                let name = file.file_name()?.to_string_lossy();
                row = Some(finished.unchanged(frame, folder, &name)?);
            }
        }
        row.cloned()
    }

    /// Returns the rows of all frames if the run resumes and is complete, so that nothing needs to be loaded. Returns
    /// `None` for an empty shard, because its statistics describe the scene.
    pub(super) fn finished(
        &self,
        settings: &RenderSettings,
        files: &FrameFiles,
    ) -> Result<Option<Vec<FrameRecord>>, CliError> {
        let Some(found) = self.manifest.as_ref().filter(|_| settings.resume) else {
            return Ok(None);
        };
        // The journal does not describe the video and the rays, so they are written again.
        if files.has_video || settings.rays_out.is_some() {
            return Ok(None);
        }
        let all = all_frames(settings, found.key_frames)?;
        let frames = self.divide(frame_list::of_shard(&all, settings.shard), files);
        let is_complete = frames.todo.is_empty() && !frames.done.is_empty();
        Ok(is_complete.then_some(frames.done))
    }

    /// Returns the statistics of the earlier run without its frames.
    pub(super) fn statistics(&self) -> Option<Value> {
        let (_, finished) = self.folders.first()?;
        finished.stats.clone()
    }

    /// Writes the manifest to all folders, and begins a journal in each. Fails if another run has begun in a folder.
    pub(super) fn begin(
        self,
        settings: &RenderSettings,
        plan: &RunPlan,
        stats: &Value,
    ) -> Result<Vec<Journal>, CliError> {
        let shard = settings.shard.map(|shard| [shard.number, shard.of]);
        let begin = |(folder, _): (PathBuf, JournalContents)| {
            let found = Manifest::in_folder(&folder).ok().flatten();
            if settings.overwrite && found.as_ref() != Some(&plan.manifest) {
                output::clear_run(&folder).map_err(CliError::invalid)?;
            }
            let mut journal = Journal::open(&folder, shard).map_err(CliError::invalid)?;
            plan.write_manifest(&folder)?;
            journal.begin(plan.list.clone(), stats.clone())?;
            Ok(journal)
        };
        self.folders.into_iter().map(begin).collect()
    }
}

impl RunPlan {
    /// Writes the manifest to a folder, unless the folder has an equal one. Fails if the folder contains another run.
    fn write_manifest(&self, folder: &Path) -> Result<(), CliError> {
        let journals = JournalContents::in_folder(folder).map_err(CliError::invalid)?;
        // Journal lines follow a manifest. If it is missing, the lines belong to an unknown run.
        if journals.is_empty() {
            self.manifest.write_new(folder)?;
        }
        match Manifest::in_folder(folder).map_err(CliError::invalid)? {
            Some(found) => check_same_run(folder, &found, &self.manifest),
            None => Err(CliError::invalid(format!(
                "{} holds an unknown run, because it has no manifest; --overwrite replaces it",
                folder.display()
            ))),
        }
    }
}

/// Fails if the manifest `found` in a folder differs from the planned one.
fn check_same_run(folder: &Path, found: &Manifest, planned: &Manifest) -> Result<(), CliError> {
    found.difference(planned).map_or(Ok(()), |difference| {
        let folder = folder.display();
        Err(CliError::invalid(format!(
            "{folder} holds another run: {difference}; --overwrite replaces it"
        )))
    })
}

/// Returns all frames of a run over a motion with `key_frames` key frames.
pub(super) fn all_frames(
    settings: &RenderSettings,
    key_frames: usize,
) -> Result<Vec<Frame>, CliError> {
    let frames = settings.frames.as_ref();
    frame_list::list(
        frames,
        settings.time_range,
        key_frames,
        is_demo(&settings.scene),
    )
}

/// Returns the manifest of a run over a motion with `key_frames` key frames.
pub(super) fn manifest(settings: &RenderSettings, key_frames: usize) -> Result<Manifest, CliError> {
    let files = scene::files(&settings.scene, settings.source.allow_outside)?;
    // The name is recorded for demos, which have no files, and for joined or placed inputs, because it contains their
    // placements. Other scenes are identified by the digests of their files, so their folder may change.
    let is_placed = settings.scene.contains(['+', '@']);
    let name = (files.is_empty() || is_placed).then(|| settings.scene.clone());
    let files = output::digests(&files).map_err(CliError::invalid)?;
    let camera = serde_json::from_value(json!(settings.camera));
    let mut options: BTreeMap<_, _> = camera.map_err(CliError::failed)?;
    options.extend(other_options(settings, key_frames));
    Ok(Manifest {
        schema: SCHEMA,
        version: VERSION.to_owned(),
        scene: SceneId { name, files },
        key_frames,
        options,
    })
}

/// Returns the options that affect the contents of the files, apart from those of the camera.
fn other_options(settings: &RenderSettings, key_frames: usize) -> BTreeMap<String, Value> {
    let RenderSettings { source, tracer, .. } = settings;
    let mut all = vec![
        ("fps", json!(source.fps)),
        ("clip", json!(source.clip)),
        // Decides whether key frames are paged. The default view is then fitted to their bounding boxes, otherwise to
        // their vertices.
        ("key-memory", json!(source.key_memory)),
        ("frames", frames_value(settings, key_frames)),
        ("intersector", json!(tracer.intersector.name())),
    ];
    // Decides whether material libraries outside the folder are read, so it affects colours.
    if source.allow_outside {
        all.push(("allow-outside", json!(true)));
    }
    if source.recentre {
        all.push(("recentre", json!(true)));
    }
    // The hits of these intersectors depend on the device.
    if !tracer.intersector.is_equal_across_backends() {
        all.push(("backend", json!(backend_name(tracer.device.backend))));
        all.push(("adapter", json!(tracer.device.adapter)));
    }
    let owned = |(name, value): (&str, Value)| (name.to_owned(), value);
    all.into_iter().map(owned).collect()
}

/// Returns the value of `frames` in the manifest. Runs with different lists of key times are compatible, because the
/// time of a listed frame does not depend on the list. The times of evenly spread frames depend on their number and
/// range.
fn frames_value(settings: &RenderSettings, key_frames: usize) -> Value {
    let frames = settings.frames.as_ref();
    if let Some(FrameChoice::Keys(_)) = frames {
        return json!("key times");
    }
    let is_demo = is_demo(&settings.scene);
    let EvenFrames { count, range } =
        EvenFrames::of(frames, settings.time_range, key_frames, is_demo);
    json!({ "count": count, "from": range.from, "to": range.to })
}
