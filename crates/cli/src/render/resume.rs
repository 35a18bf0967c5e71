//! Frames that an earlier run left in the output folders, and the frames that remain.

use super::RenderSettings;
use super::files::{FrameFiles, OutputFolder};
use crate::devices::backend_name;
use crate::error::CliError;
use crate::frame_list::{self, EvenFrames, FrameChoice, Shard};
use crate::machine::VERSION;
use crate::scene_source::{is_demo, may_have_clip};
use output::{Journal, JournalContents, Manifest, SCHEMA, SceneId};
use pipeline::{Frame, FrameRecord};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// An earlier run in the output folders.
pub(super) struct EarlierRun {
    /// Contents of the journals of each output folder. They are read only if the run resumes.
    journals: Vec<JournalContents>,
    manifest: Option<Manifest>,
}

/// The manifest of a run, the numbers of all its frames in all shards, and the shard that is rendered.
pub(super) struct RunPlan {
    pub(super) manifest: Manifest,
    pub(super) list: Vec<u64>,
    pub(super) shard: Option<Shard>,
}

/// The locked journals of a folder in which a run can begin.
enum LockedJournals {
    /// All journals of another run, which the new run replaces.
    Replaced(Vec<Journal>),
    /// The journal that the run continues, if it exists.
    Continued(Option<Journal>),
}

/// Frames that are complete, and the others.
pub(super) struct DividedFrames {
    pub(super) done: Vec<FrameRecord>,
    pub(super) todo: Vec<Frame>,
}

impl EarlierRun {
    /// Reads the output folders, before anything is loaded. Fails if a folder contains another or an unknown run, unless
    /// `--overwrite` is set.
    pub(super) fn find(settings: &RenderSettings, files: &FrameFiles) -> Result<Self, CliError> {
        let (mut journals, mut earlier) = (Vec::new(), None);
        for OutputFolder { path, .. } in &files.folders {
            let found = if settings.overwrite {
                None
            } else {
                known_run(path)?
            };
            if let Some(found) = &found {
                check_same_run(path, found, &manifest(settings, found.key_frames)?)?;
            }
            journals.push(if settings.resume && found.is_some() {
                JournalContents::in_folder(path).map_err(CliError::invalid)?
            } else {
                JournalContents::default()
            });
            earlier = found.or(earlier);
        }
        Ok(Self {
            journals,
            manifest: earlier,
        })
    }

    /// Separates frames whose files are all complete from those to render. With a video, all frames are rendered.
    pub(super) fn divide(&self, frames: Vec<Frame>, files: &FrameFiles) -> DividedFrames {
        let (mut done, mut todo) = (Vec::new(), Vec::new());
        for frame in frames {
            let record = self.record(frame.index, files);
            match record.filter(|_| !files.has_video) {
                Some(record) => done.push(record),
                None => todo.push(frame),
            }
        }
        DividedFrames { done, todo }
    }

    fn record(&self, frame: u64, files: &FrameFiles) -> Option<FrameRecord> {
        let mut record = None;
        for (folder, journals) in files.folders.iter().zip(&self.journals) {
            for kind in &folder.kinds {
                let name = kind.file_name(frame);
                record = Some(journals.unchanged(frame, &folder.path, &name)?);
            }
        }
        record.cloned()
    }

    /// Returns the records of all frames if the run resumes and is complete, so that nothing needs to be loaded.
    /// Returns `None` for an empty shard: its statistics describe the scene, which must be loaded.
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
        self.journals.first()?.stats.clone()
    }
}

impl RunPlan {
    /// Writes the manifest to all folders, and begins a journal in each. Fails if another run has begun in a folder,
    /// unless `overwrite` is set. No folder is changed before all folders are checked and the journals to replace or
    /// continue are locked.
    pub(super) fn begin(
        &self,
        files: &FrameFiles,
        overwrite: bool,
        stats: &Value,
    ) -> Result<Vec<Journal>, CliError> {
        let folders = files.folders.iter();
        let locked = folders.map(|folder| self.lock(&folder.path, overwrite));
        let locked: Vec<_> = locked.collect::<Result<_, _>>()?;
        let folders = files.folders.iter().zip(locked);
        folders
            .map(|(folder, journals)| self.begin_in(folder, journals, stats))
            .collect()
    }

    /// Locks the journals that the run replaces or continues. Fails if the folder contains another run, unless
    /// `overwrite` is set.
    fn lock(&self, folder: &Path, overwrite: bool) -> Result<LockedJournals, CliError> {
        let found = Manifest::in_folder(folder).ok().flatten();
        if overwrite && found.as_ref() != Some(&self.manifest) {
            let all = Journal::open_all(folder).map_err(CliError::invalid)?;
            return Ok(LockedJournals::Replaced(all));
        }
        let own = Journal::open_existing(folder, self.shard()).map_err(CliError::invalid)?;
        self.check(folder)?;
        Ok(LockedJournals::Continued(own))
    }

    /// Removes the run that is replaced, if any. Writes the manifest and begins the journal.
    fn begin_in(
        &self,
        folder: &OutputFolder,
        journals: LockedJournals,
        stats: &Value,
    ) -> Result<Journal, CliError> {
        let OutputFolder { path, kinds } = folder;
        let own = match journals {
            LockedJournals::Replaced(all) => {
                output::clear_run(path, &all).map_err(CliError::invalid)?;
                None
            }
            LockedJournals::Continued(own) => own,
        };
        let journal = own.map_or_else(|| Journal::open(path, self.shard()), Ok);
        let mut journal = journal.map_err(CliError::invalid)?;
        self.manifest.write_new(path)?;
        // Another run may have begun since the first check.
        self.check(path)?;
        journal.begin(self.list.clone(), kinds.clone(), stats.clone())?;
        Ok(journal)
    }

    /// Returns the number of the shard and the number of all shards.
    fn shard(&self) -> Option<[usize; 2]> {
        self.shard.map(|shard| [shard.number, shard.of])
    }

    /// Fails if a folder contains another run.
    fn check(&self, folder: &Path) -> Result<(), CliError> {
        match known_run(folder)? {
            Some(found) => check_same_run(folder, &found, &self.manifest),
            None => Ok(()),
        }
    }
}

/// Returns the manifest of the run in a folder, or `None` if no run has begun there. Fails if a journal has lines but
/// there is no manifest.
fn known_run(folder: &Path) -> Result<Option<Manifest>, CliError> {
    let manifest = || Manifest::in_folder(folder).map_err(CliError::invalid);
    if let Some(found) = manifest()? {
        return Ok(Some(found));
    }
    let journals = JournalContents::in_folder(folder).map_err(CliError::invalid)?;
    if journals.is_empty() {
        return Ok(None);
    }
    // A manifest is written before any line. Another run may have written both just now.
    let found = manifest()?.ok_or_else(|| {
        CliError::invalid(format!(
            "{} holds an unknown run, because it has no manifest; --overwrite replaces it",
            folder.display()
        ))
    });
    found.map(Some)
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
    let is_joined = scene::is_joined(&settings.scene)?;
    let name = (files.is_empty() || is_joined).then(|| settings.scene.clone());
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
        ("clip", json!(source.clip)),
        // Decides whether key frames are read during playback. If so, the default view is fitted to their bounding
        // boxes, otherwise to their vertices.
        ("key-memory", json!(source.key_memory)),
        ("frames", frames_value(settings, key_frames)),
        ("intersector", json!(tracer.intersector.name())),
    ];
    // Without a clip, the rate applies only to videos.
    if may_have_clip(&settings.scene) {
        all.push(("fps", json!(source.fps)));
    }
    // Decides whether material libraries outside the folder are read, so it affects colours.
    if source.allow_outside {
        all.push(("allow-outside", json!(true)));
    }
    if source.recentre {
        all.push(("recentre", json!(true)));
    }
    // The hits of these intersectors depend on the device.
    if !tracer.intersector.is_equal_across_backends() {
        all.push(("backend", json!(backend_name(tracer.backend))));
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
