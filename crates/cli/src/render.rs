//! `abvh render`: renders an animation to pictures, hits and statistics.

use crate::args::RenderArgs;
use crate::conflicts::Files;
use crate::resume::{self, Earlier, manifest};
use crate::session::{self, Ask, Setup};
use crate::stop::{self, Stop};
use crate::talk::Progress;
use crate::writer::{Lent, Outputs, Writer};
use crate::{frames, info, inspect, table, talk, values};
use abvh::Tracer;
use abvh::frames::{Frame, Wanted};
use geom::{Camera, Point};
use output::{FrameStats, Journal, RunTimeline, SCHEMA, Video};
use scene::Scene;
use serde_json::{Value, json};
use shading::View;
use std::path::Path;
use std::time::Instant;

pub(crate) fn run(args: &RenderArgs) -> Result<(), Stop> {
    check_files(args)?;
    let outputs = Outputs::of(args);
    let mut start_up = vec![("begin", Instant::now())];
    let mut passed = |step| start_up.push((step, Instant::now()));
    let earlier = Earlier::look(args, &outputs)?;
    if let Some(rows) = earlier.finished(args, &outputs)? {
        return nothing_left(args, &earlier, &rows);
    }
    let asked = ask(args);
    let mut opening = session::begin(&asked);
    let rays = values::pixels(args.size);
    passed("look at files");
    let scene = scene::open(&args.scene, &args.source.options_of_run(rays))?;
    passed("read the scene");
    let keys = scene.animation.whole_times();
    let all = resume::listed(args, keys)?;
    let frames = frames::of_shard(&all, args.shard);
    if frames.is_empty() {
        return no_frames(args, &scene, (earlier, &outputs), &all);
    }
    let view = view(args, &scene)?;
    let camera = camera(&view, args.size)?;
    let query = shading::query((&camera, view.light));
    let ask = asked.over(&frames, query);
    // The encoder starts while the device is opened.
    let videos = [&args.video, &args.y4m].map(Option::as_deref);
    let video = Video::begin(videos, args.size, args.source.fps).map_err(Stop::bad)?;
    let (mut tracer, setup) = session::start(&scene, &ask, &mut opening)?;
    passed("open the device, load the scene");
    let mut wanted = outputs.wanted();
    let shades = tracer.prepare_frames((&camera, view.light), wanted)?;
    if wanted.pixels && !shades {
        wanted = Wanted::HITS;
    }
    let new = outputs.prepare()?;
    if let Some(file) = &args.rays_out {
        // A run that does not begin leaves no folders.
        let tidy = |_: &_| new.iter().for_each(|dir| drop(std::fs::remove_dir(dir)));
        let offset = scene.facts.offset;
        output::write_rays(file, camera.pixels(), camera.rays(), offset).inspect_err(tidy)?;
    }
    // A video needs all frames, including those whose files are complete.
    let (old, todo) = match outputs.video.any() {
        true => (Vec::new(), frames),
        false => earlier.divide(frames, &outputs),
    };
    let own = manifest(args, keys)?;
    let head = resume::alone(head(args, &scene, &setup), &outputs, (&own, &all));
    let mut journals = earlier.begin(args, &all, (&own, &head))?;
    passed("begin files");
    let mut notes = args.timeline.is_some().then(RunTimeline::default);
    if let Some(notes) = &mut notes {
        notes.start_up = start_up;
    }
    stop::let_signals_wait();
    let rows = trace_all(
        args,
        (&scene, &camera, view.light),
        (todo, old.len()),
        (tracer, &setup),
        (&outputs, video, wanted),
        (&mut journals, notes.as_mut()),
    )?;
    if let Some(file) = &args.stats {
        resume::write_stats(file, &resume::joined(head, &[&old[..], &rows].concat()))?;
    }
    if let (Some(file), Some(notes)) = (&args.timeline, &notes) {
        let remarks = json!({ "caption": setup.caption, "command_line": info::command_line() });
        notes.write(file, remarks)?;
    }
    tell(args, &results(args, &scene, &setup, &rows))
}

/// Handles a shard without frames, if there are more shards than frames. The folders still describe the run.
fn no_frames(
    args: &RenderArgs,
    scene: &Scene,
    (earlier, outputs): (Earlier, &Outputs),
    all: &[Frame],
) -> Result<(), Stop> {
    outputs.prepare()?;
    let own = manifest(args, scene.animation.whole_times())?;
    earlier.begin(args, all, (&own, &Value::Null))?;
    if let Some(file) = &args.stats {
        let version = env!("CARGO_PKG_VERSION");
        let scene = inspect::scene_facts(scene);
        let head = json!({ "schema": SCHEMA, "version": version, "scene": scene });
        let head = resume::alone(head, outputs, (&own, all));
        resume::write_stats(file, &resume::joined(head, &[]))?;
    }
    let why = "this shard has no frames: there are more shards than frames\n";
    tell(args, why)
}

/// Refuses to write files that would overwrite others or that cannot be written.
fn check_files(args: &RenderArgs) -> Result<(), Stop> {
    let images = (!args.no_images).then(|| ("--out", args.out.clone()));
    let hits = args.hits.clone().map(|dir| ("--hits", dir));
    let files = Files {
        folders: images.into_iter().chain(hits).collect(),
        ..Files::written(&[
            ("--stats", &args.stats),
            ("--timeline", &args.timeline),
            ("--rays-out", &args.rays_out),
            ("--video", &args.video),
            ("--y4m", &args.y4m),
        ])
    };
    files.check(std::slice::from_ref(&args.scene))
}

/// Returns the request for a backend, before the frames are known.
fn ask(args: &RenderArgs) -> Ask<'_> {
    Ask {
        adapter: args.device.adapter.as_deref(),
        threads: args.device.threads,
        builder_threads: args.device.builder_threads,
        lockstep: args.lockstep,
        rays: values::pixels(args.size),
        predict: args.predict,
        ..Ask::of(args.device.backend, args.intersector, args.update)
    }
}

/// Prints results to standard output, or to standard error if statistics or a video use standard output.
fn tell(args: &RenderArgs, text: &str) -> Result<(), Stop> {
    let files = [&args.stats, &args.y4m].map(Option::as_deref);
    if !files.contains(&Some(Path::new("-"))) {
        return talk::print(text);
    }
    if !args.quiet {
        talk::say(text.trim_end());
    }
    Ok(())
}

/// Writes only statistics, from the results of earlier runs. All other files are complete.
fn nothing_left(args: &RenderArgs, earlier: &Earlier, rows: &[FrameStats]) -> Result<(), Stop> {
    if let (Some(file), Some(stats)) = (&args.stats, earlier.stats(rows)) {
        resume::write_stats(file, &stats)?;
    }
    let all = rows.len();
    let text = format!("nothing is left to be done: all {all} frames are there\n");
    tell(args, &text)
}

/// Returns the view that frames the motion, with the requested points in place of its own.
fn view(args: &RenderArgs, scene: &Scene) -> Result<View, Stop> {
    let framed = shading::frame_scene(&scene.animation, args.fov, args.size);
    let point = |option, requested: Option<[f64; 3]>, framed| match requested {
        Some(point) => in_scene(option, point, scene),
        None => Ok(framed),
    };
    Ok(View {
        eye: point("--eye", args.eye, framed.eye)?,
        look_at: point("--look-at", args.look_at, framed.look_at)?,
        up: args.up.unwrap_or(framed.up),
        light: point("--light", args.light, framed.light)?,
        ..framed
    })
}

/// Converts a point of the scene's files to the coordinates of its key frames.
fn in_scene(option: &str, point: [f64; 3], scene: &Scene) -> Result<Point, Stop> {
    let offset = scene.facts.offset.unwrap_or_default();
    let moved: Point = std::array::from_fn(|i| (point[i] - offset[i]) as f32);
    match moved.iter().all(|x| x.is_finite()) {
        true => Ok(moved),
        false => Err(Stop::bad(format!("{option} {point:?} is too far away"))),
    }
}

fn camera(view: &View, size: [u32; 2]) -> Result<Camera, Stop> {
    view.camera(size).ok_or_else(|| {
        let View { eye, look_at, up, .. } = view;
        Stop::bad(if eye == look_at {
            format!("--eye and --look-at are the same point, {eye:?}: there is no direction to look in")
        } else if *up == [0.0; 3] {
            "--up has no direction".to_owned()
        } else {
            format!("no camera at {eye:?} looking at {look_at:?} has {up:?} for up: they lie in one line")
        })
    })
}

/// Renders every frame and writes its files. Returns one row per frame.
fn trace_all(
    args: &RenderArgs,
    shown @ (scene, camera, light): (&Scene, &Camera, Point),
    (todo, done): (Vec<Frame>, usize),
    (mut tracer, setup): (Tracer, &Setup),
    (outputs, video, wanted): (&Outputs, Option<Video<Lent>>, Wanted),
    (journals, notes): (&mut [Journal], Option<&mut RunTimeline>),
) -> Result<Vec<FrameStats>, Stop> {
    let progress = Progress::new(todo.len() as u64, args.quiet);
    let taken = setup.auto.iter().map(ToString::to_string);
    for remark in taken.chain(scene.facts.notes.iter().cloned()) {
        progress.say(&remark);
    }
    if done > 0 {
        let all = done + todo.len();
        progress.say(&format!("{done} of {all} frames are there already"));
    }
    let made = (outputs, video, wanted);
    let writer = Writer::new(shown, made, (journals, notes), progress);
    let mut places = 0..;
    rayon::in_place_scope(|scope| {
        tracer.render_frames::<Stop>(&todo, (camera, light), wanted, |frame, answers| {
            writer.take(scope, places.next().unwrap_or_default(), frame, answers)
        })
    })?;
    // The device is closed while an encoder finishes.
    drop(tracer);
    writer.rows()
}

fn results(args: &RenderArgs, scene: &Scene, setup: &Setup, rows: &[FrameStats]) -> String {
    let [width, height] = args.size;
    let mut text = format!(
        "{}: {} ({} moving), {}; {} of {width}x{height}\n{}\n",
        scene.name,
        table::counted(scene.animation.triangle_count(), table::TRIANGLES),
        table::grouped(scene.animation.moving_count()),
        table::counted(scene.animation.key_count(), table::KEY_FRAMES),
        table::counted(rows.len(), table::FRAMES),
        setup.caption,
    );
    if !rows.is_empty() {
        text += &table::stages(rows);
        text += &output::trees(rows);
        text += &output::memory(rows);
        text += &output::rates(rows, values::pixels(args.size));
    }
    if !args.no_images {
        text += &format!("pictures: {}\n", args.out.display());
    }
    text
}

/// Returns the statistics without frames.
fn head(args: &RenderArgs, scene: &Scene, setup: &Setup) -> Value {
    let mut head = json!(setup);
    head["schema"] = json!(SCHEMA);
    head["version"] = json!(env!("CARGO_PKG_VERSION"));
    head["scene"] = inspect::scene_facts(scene);
    head["size"] = json!(args.size);
    head["expected_memory"] = json!(setup.memory);
    head
}
