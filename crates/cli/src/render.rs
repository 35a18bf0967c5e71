//! `abvh render`: renders an animation to pictures, hits and statistics.

mod files;
mod frame_writer;
mod resume;
pub(crate) mod statistics;

use crate::camera::{CameraSettings, LitCamera};
use crate::command::{Requirement, RunCommand};
use crate::console::{self, ProgressLine};
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::frame_list::{self, FrameChoice, Shard, TimeRange};
use crate::machine::VERSION;
use crate::parsers;
use crate::scene_source::{self, SceneSettings};
use crate::setup::{self, Setup, Started};
use crate::signals;
use crate::table;
use crate::tracer_settings::{TracerSettings, Workload};
use abvh::Tracer;
use abvh::frames::{Frame, FrameRecord, OutputSelection};
use clap::Args;
use files::{FrameFiles, NewFolders};
use frame_writer::{FrameContext, FrameLog, FrameWriter};
use output::{FileKind, SCHEMA, Video, VideoFiles};
use resume::{DividedFrames, EarlierRun, RunPlan};
use scene::Scene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(crate) struct RenderSettings {
    /// Scene. Either a demo, demo:NAME or demo:NAME:TRIANGLES, with NAME grove, collide, shatter, twist or hall. Or a
    /// directory or glob of .obj or .ply files, one per key frame. Or one .obj, .ply, .gltf or .glb file. '+' joins
    /// inputs; '@x,y,z' or '@x,y,z*scale' places an input: hall.obj+figure.glb@2,0,-1*0.5. The name of an existing file
    /// or folder is always one input. Moving inputs need equal numbers of key frames; an input with one key frame is
    /// static
    #[arg(default_value = "demo:grove", value_parser = parsers::scene())]
    pub(crate) scene: String,
    #[command(flatten)]
    source: SceneSettings,
    #[command(flatten)]
    pub(crate) tracer: TracerSettings,
    /// Frames: N spread evenly over the time range, both ends included. Or the key times A..B, without B. Or a list of
    /// key times, such as 1,4,10-20x2 (10 to 20 in steps of 2). Frames at key times are numbered by key time, others
    /// from 0000 [default: 48 for a demo, else one per key frame up to 96]
    #[arg(long, value_name = "N|A..B|LIST")]
    frames: Option<FrameChoice>,
    /// Render only block I of N blocks of frames, counted from 1. auto reads I and N from the variables of a Slurm job
    /// array
    #[arg(long, value_name = "I/N|auto")]
    shard: Option<Shard>,
    /// Time range, in key frames [default: the whole motion]
    #[arg(long, value_name = "T0..T1", allow_hyphen_values = true)]
    time_range: Option<TimeRange>,
    #[command(flatten)]
    pub(crate) camera: CameraSettings,
    /// Directory for pictures: frame_0000.png and so on
    #[arg(long, value_name = "DIR", default_value = "abvh-out", value_parser = parsers::file())]
    pub(crate) out: PathBuf,
    /// Write no pictures
    #[arg(long, conflicts_with = "out")]
    no_images: bool,
    /// Directory for hits: hits_0000.npz and so on
    #[arg(long, value_name = "DIR", value_parser = parsers::file())]
    hits: Option<PathBuf>,
    /// File for a video, encoded by the `ffmpeg` on PATH: .mp4, .webm, .mkv or .mov. It plays --fps frames per second
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    video: Option<PathBuf>,
    /// File for an uncompressed video (YUV4MPEG2, 4:4:4), - for standard output
    #[arg(long, value_name = "FILE.y4m")]
    y4m: Option<PathBuf>,
    /// File for statistics of every frame, - for standard output
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// File for the primary rays of a frame, as input for `abvh trace`
    #[arg(long, value_name = "FILE.npy", value_parser = parsers::file())]
    rays_out: Option<PathBuf>,
    /// Resume the run in the output folders: skip frames whose files are complete, by length and digest. A video is made
    /// again from all frames. If the folders hold another run, fail and name the difference
    #[arg(long)]
    resume: bool,
    /// Replace another run in the output folders
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Print no progress and no remarks
    #[arg(long, short)]
    quiet: bool,
}

impl RunCommand for RenderSettings {
    fn run(&self) -> Result<(), CliError> {
        self.check_files()?;
        let files = FrameFiles::of(self);
        let earlier = EarlierRun::find(self, &files)?;
        if let Some(records) = earlier.finished(self, &files)? {
            return finish_complete(self, &earlier, &records);
        }
        let opening = setup::begin(&self.tracer);
        let rays = self.camera.pixels();
        let scene = self.source.open(&self.scene, rays)?;
        let keys = scene.animation.key_count();
        let all = resume::all_frames(self, keys)?;
        let frames = frame_list::of_shard(&all, self.shard);
        let plan = RunPlan {
            manifest: resume::manifest(self, keys)?,
            list: all.iter().map(|frame| frame.index).collect(),
            shard: self.shard,
        };
        if frames.is_empty() {
            return finish_empty_shard(self, &files, &scene, &plan);
        }
        let lit_camera = self.camera.aim(&scene)?;
        // Locals are dropped in reverse order. So `video`, declared later, removes its unfinished file before
        // `new_folders` removes the folder.
        let mut new_folders = NewFolders::default();
        if files.has_video {
            // The video may be in a new output folder.
            files.create_folders(&mut new_folders)?;
        }
        // The encoder starts while the device is opened.
        let videos = VideoFiles {
            encoded: self.video.as_deref(),
            y4m: self.y4m.as_deref(),
        };
        let video = Video::begin(videos, self.camera.size, self.source.fps);
        let video = video.map_err(CliError::invalid)?;
        let workload = Workload {
            frames: &frames,
            rays,
        };
        let Started { mut tracer, setup } =
            setup::start_tracer(&scene, &self.tracer, workload, opening)?;
        let mut wanted = OutputSelection {
            hits: files.has(FileKind::Hits),
            pixels: files.has(FileKind::Picture) || files.has_video,
        };
        let shades_on_device = tracer.prepare_frames(lit_camera.view(), wanted)?;
        // If the host shades, it needs the hits of each frame. They count towards the memory limit of the frame writer.
        wanted.hits |= wanted.pixels && !shades_on_device;
        files.create_folders(&mut new_folders)?;
        self.write_rays(&scene, &lit_camera)?;
        let DividedFrames { done, todo } = earlier.divide(frames, &files);
        // Frees the contents of its journals before frames are rendered.
        drop(earlier);
        let stats = statistics_of(self, &scene, &setup);
        let mut journals = plan.begin(&files, self.overwrite, &stats)?;
        signals::defer();
        let context = FrameContext {
            scene: &scene,
            lit_camera: &lit_camera,
            files: &files,
            wanted,
        };
        let log = FrameLog {
            journals: &mut journals,
            progress: self.begin_progress(&scene, &setup, todo.len(), done.len()),
            video,
            records: Vec::new(),
            failed: None,
        };
        let records = render_frames(tracer, &todo, context, log)?;
        self.write_stats(stats, &[&done[..], &records].concat())?;
        self.print(&results(self, &scene, &setup, &records))
    }

    fn requirements(&self) -> Vec<Requirement> {
        let writes_files = !self.no_images || self.hits.is_some();
        let needs_files =
            |option| Requirement::new(option, writes_files, "applies only with pictures or --hits");
        let mut all = self.tracer.requirements();
        all.extend(["resume", "overwrite"].map(needs_files));
        all.extend(scene_source::requirements(&[&self.scene]));
        for fps in all.iter_mut().filter(|r| r.option == "fps") {
            // Videos play --fps frames per second.
            fps.is_met |= self.has_video();
            fps.text = "applies only to glTF scenes and videos";
        }
        all
    }

    fn threads(&self) -> Option<usize> {
        self.tracer.device.threads
    }
}

impl RenderSettings {
    fn has_video(&self) -> bool {
        self.video.is_some() || self.y4m.is_some()
    }

    /// Fails if an output would overwrite an input or another output, or cannot be written.
    fn check_files(&self) -> Result<(), CliError> {
        let outputs = [&self.stats, &self.y4m].map(Option::as_deref);
        if outputs == [Some(Path::new("-")); 2] {
            let message = "--stats - and --y4m - cannot share standard output";
            return Err(CliError::invalid(message));
        }
        let pictures = (!self.no_images).then(|| ("--out", self.out.clone()));
        let hits = self.hits.clone().map(|dir| ("--hits", dir));
        let files = CommandFiles {
            folders: pictures.into_iter().chain(hits).collect(),
            ..CommandFiles::written(&[
                ("--stats", &self.stats),
                ("--rays-out", &self.rays_out),
                ("--video", &self.video),
                ("--y4m", &self.y4m),
            ])
        };
        files.check(std::slice::from_ref(&self.scene))
    }

    /// Prints results to standard output, or to standard error if statistics or a video use standard output.
    fn print(&self, text: &str) -> Result<(), CliError> {
        let files = [&self.stats, &self.y4m].map(Option::as_deref);
        if !files.contains(&Some(Path::new("-"))) {
            return console::print(text);
        }
        if !self.quiet {
            console::say(text.trim_end());
        }
        Ok(())
    }

    /// Writes the primary rays, if requested.
    fn write_rays(&self, scene: &Scene, lit_camera: &LitCamera) -> Result<(), CliError> {
        if let Some(file) = &self.rays_out {
            let (camera, offset) = (&lit_camera.camera, scene.facts.offset);
            output::write_rays(file, camera.pixels(), camera.rays(), offset)?;
        }
        Ok(())
    }

    /// Starts the progress display. Prints the choices of `auto` and the notes on the scene. `todo` frames remain, and
    /// `done` frames are complete already.
    fn begin_progress(
        &self,
        scene: &Scene,
        setup: &Setup,
        todo: usize,
        done: usize,
    ) -> ProgressLine {
        let progress = ProgressLine::new(todo as u64, self.quiet);
        let choices = setup.auto.iter().map(ToString::to_string);
        for remark in choices.chain(scene.facts.notes.iter().cloned()) {
            progress.say(&remark);
        }
        if done > 0 {
            progress.say(&format!(
                "{done} of {} frames are complete already",
                done + todo
            ));
        }
        progress
    }

    fn write_stats(&self, stats: Value, records: &[FrameRecord]) -> Result<(), CliError> {
        match &self.stats {
            Some(file) => statistics::write(file, &statistics::with_records(stats, records)),
            None => Ok(()),
        }
    }
}

/// Finishes a run whose frames are all complete. Writes only the statistics, from the journals of earlier runs.
fn finish_complete(
    settings: &RenderSettings,
    earlier: &EarlierRun,
    records: &[FrameRecord],
) -> Result<(), CliError> {
    if let Some(stats) = earlier.statistics() {
        settings.write_stats(stats, records)?;
    }
    let all = records.len();
    settings.print(&format!(
        "nothing is left to render: all {all} frames are complete\n"
    ))
}

/// Finishes a shard without frames, which exists if there are more shards than frames. Writes the manifest, so that the
/// folders describe the run.
fn finish_empty_shard(
    settings: &RenderSettings,
    files: &FrameFiles,
    scene: &Scene,
    plan: &RunPlan,
) -> Result<(), CliError> {
    let mut new_folders = NewFolders::default();
    files.create_folders(&mut new_folders)?;
    plan.begin(files, settings.overwrite, &Value::Null)?;
    let scene = scene_source::scene_facts(scene);
    let stats = json!({ "schema": SCHEMA, "version": VERSION, "scene": scene });
    settings.write_stats(stats, &[])?;
    settings.print("this shard has no frames: there are more shards than frames\n")
}

/// Renders every frame and writes its files. Returns one record per frame.
fn render_frames(
    mut tracer: Tracer,
    frames: &[Frame],
    context: FrameContext<'_>,
    log: FrameLog<'_>,
) -> Result<Vec<FrameRecord>, CliError> {
    let (view, wanted) = (context.lit_camera.view(), context.wanted);
    let writer = FrameWriter::new(context, log);
    let mut places = 0..;
    rayon::in_place_scope(|scope| {
        tracer.render_frames::<CliError>(frames, view, wanted, |frame, outputs| {
            writer.write(scope, places.next().unwrap_or_default(), frame, outputs)
        })
    })?;
    // Close the device while the video encoder finishes.
    drop(tracer);
    writer.finish()
}

fn results(
    settings: &RenderSettings,
    scene: &Scene,
    setup: &Setup,
    records: &[FrameRecord],
) -> String {
    let [width, height] = settings.camera.size;
    let mut text = format!(
        "{}: {} ({} moving), {}; {} of {width}x{height}\n{}\n",
        scene.name,
        table::counted(scene.animation.triangle_count(), table::TRIANGLES),
        table::format_count(scene.animation.moving_count()),
        table::counted(scene.animation.key_count(), table::KEY_FRAMES),
        table::counted(records.len(), table::FRAMES),
        setup.caption,
    );
    if !records.is_empty() {
        text += &table::stages(records);
        text += &output::trees_text(records);
        text += &output::memory_text(records);
    }
    if !settings.no_images {
        text += &format!("pictures: {}\n", settings.out.display());
    }
    text
}

/// Returns the statistics of a run without the records of its frames.
fn statistics_of(settings: &RenderSettings, scene: &Scene, setup: &Setup) -> Value {
    let mut stats = json!(setup);
    stats["schema"] = json!(SCHEMA);
    stats["version"] = json!(VERSION);
    stats["scene"] = scene_source::scene_facts(scene);
    stats["size"] = json!(settings.camera.size);
    stats["expected_memory"] = json!(setup.memory);
    stats
}
