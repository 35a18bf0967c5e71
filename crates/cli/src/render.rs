//! `abvh render`: an animation to pictures, hits and statistics.

use crate::args::RenderArgs;
use crate::choose::{self, Ahead, Run};
use crate::journal::Journal;
use crate::outputs::Outputs;
use crate::progress::Progress;
use crate::resume::{self, Earlier};
use crate::session::{self, Ask, Session};
use crate::stop::Stop;
use crate::timeline::Notes;
use crate::video::{self, Video};
use crate::writer::{Done, Writer};
use crate::{conflicts, frames, memory, open, record, signals, table, talk};
use backend::{Query, QueryKind, Rays};
use geom::Camera;
use output::View;
use output::{FrameStats, SCHEMA, Stats};
use pipeline::{Frame, Wanted};
use scene::Scene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Renders.
pub(crate) fn run(args: &RenderArgs) -> Result<(), Stop> {
    conflicts::of_render(args)?;
    let outputs = Outputs::of(args)?;
    let mut start_up = vec![("begin", Instant::now())];
    let mut passed = |step| start_up.push((step, Instant::now()));
    let earlier = Earlier::look(args, &outputs)?;
    let finished = earlier.finished(args, &outputs)?;
    if let Some(rows) = finished.filter(|_| !args.makes_video()) {
        return nothing_left(args, &earlier, &rows);
    }
    let is_demo = frames::is_demo(&args.scene);
    let foreseen = frames::foreseen(args.frames.as_ref(), args.time_range, is_demo);
    if let Some(all) = foreseen.filter(|all| frames::of_shard(all, args.shard).is_empty()) {
        return no_frames(args, (earlier, &outputs), &all, None);
    }
    let _drivers = open::load_drivers(args.device.backend);
    let rays = args.size.count();
    passed("look at files");
    let scene = scene::open(&args.scene, &memory::with_run(args.source.options(), rays))?;
    passed("read the scene");
    let keys = scene.animation.whole_times();
    let all = frames::list(args.frames.as_ref(), args.time_range, keys, is_demo)?;
    let frames = frames::of_shard(&all, args.shard);
    if frames.is_empty() {
        return no_frames(args, (earlier, &outputs), &all, Some(keys));
    }
    let view = view(args, &scene);
    let camera = camera(&view, args.size.size)?;
    let ask = ask(args, &frames, query(&camera, &view));
    let mut session = session::start(&scene.animation, &ask)?;
    passed("open the device, load the scene");
    let (video, wanted) = pictures(args, &outputs, &scene, &mut session)?;
    session.driver.prepare(query(&camera, &view));
    let new = outputs.prepare()?;
    if let Some(file) = &args.rays_out {
        // A run that does not begin leaves no folders.
        let tidy = |_: &_| new.iter().for_each(|dir| drop(std::fs::remove_dir(dir)));
        output::write_rays(file, Pixels::new(&camera)).inspect_err(tidy)?;
    }
    // A video is made of all frames, also of those whose files are whole.
    let (old, todo) = match video.is_some() {
        true => (Vec::new(), frames),
        false => earlier.divide(frames, &outputs),
    };
    let mut head = json!(stats(args, &scene, &session, &[]));
    head["expected_memory"] = json!(session.memory);
    if args.stats.is_some() && !outputs.any() {
        head = resume::alone(args, head, &all, Some(keys))?;
    }
    let mut journals = earlier.begin(args, &all, (Some(keys), &head))?;
    passed("begin files");
    let mut notes = args.timeline.is_some().then(Notes::default);
    if let Some(notes) = &mut notes {
        notes.start_up = start_up;
    }
    signals::wait_for_checks();
    let rows = trace_all(
        args,
        (&scene, &camera, &view),
        (todo, old.len()),
        &mut session,
        (&outputs, video, wanted),
        (&mut journals, notes.as_mut()),
    )?;
    if let Some(file) = &args.stats {
        resume::write_stats(file, &resume::joined(head, &[&old[..], &rows].concat()))?;
    }
    if let (Some(file), Some(notes)) = (&args.timeline, &notes) {
        notes.write(file, &session)?;
    }
    tell(args, &results(args, &scene, &session, &rows))
}

/// What the run wants of a backend.
fn ask<'a>(args: &'a RenderArgs, frames: &'a [Frame], query: Query<'a>) -> Ask<'a> {
    Ask {
        backend: args.device.backend,
        adapter: args.device.adapter.as_deref(),
        threads: args.device.threads,
        builder_threads: args.device.builder_threads,
        method: args.method,
        update: choose::update(args.policy),
        tolerance: args.tolerance.ppm(),
        run: Some(Run { frames, query }),
        rays: args.size.count(),
        ahead: Ahead::of(frames, args.predict),
    }
}

/// The video that is asked for, and what is fetched of each frame for it and for files.
fn pictures(
    args: &RenderArgs,
    outputs: &Outputs,
    scene: &Scene,
    session: &mut Session,
) -> Result<(Option<Video>, Wanted), Stop> {
    let video = Video::begin(&video::Wanted {
        encoded: args.video.as_deref(),
        y4m: args.y4m.as_deref(),
        size: args.size.size,
        fps: args.source.fps,
    })?;
    let mut wanted = outputs.wanted();
    wanted.pixels |= video.is_some();
    if wanted.pixels && !session.driver.shade(&output::palette(&scene.colours))? {
        wanted = Wanted::HITS;
    }
    Ok((video, wanted))
}

/// Results go to standard output, unless statistics or a video go there.
fn tell(args: &RenderArgs, text: &str) -> Result<(), Stop> {
    match [&args.stats, &args.y4m].map(Option::as_deref) {
        files if files.contains(&Some(Path::new("-"))) => {
            if !args.quiet {
                talk::say(text.trim_end());
            }
            Ok(())
        }
        _ => talk::print(text),
    }
}

/// There are more shards than frames: the folders say what run this is, and nothing else is done.
fn no_frames(
    args: &RenderArgs,
    (earlier, outputs): (Earlier, &Outputs),
    all: &[Frame],
    key_times: Option<usize>,
) -> Result<(), Stop> {
    outputs.prepare()?;
    earlier.begin(args, all, (key_times, &Value::Null))?;
    if let Some(file) = &args.stats {
        let head = json!({ "schema": SCHEMA, "version": env!("CARGO_PKG_VERSION"), "scene": null });
        let head = resume::alone(args, head, all, key_times)?;
        resume::write_stats(file, &resume::joined(head, &[]))?;
    }
    tell(
        args,
        "this shard has no frames: there are more shards than frames\n",
    )
}

/// All files are there: statistics alone are written, of earlier runs.
fn nothing_left(args: &RenderArgs, earlier: &Earlier, rows: &[FrameStats]) -> Result<(), Stop> {
    if let (Some(file), Some(stats)) = (&args.stats, earlier.stats(rows)) {
        resume::write_stats(file, &stats)?;
    }
    tell(
        args,
        &format!(
            "nothing is left to be done: all {} frames are there\n",
            rows.len()
        ),
    )
}

/// The view that frames the motion, with what was asked for in its place.
fn view(args: &RenderArgs, scene: &Scene) -> View {
    let asked = &args.camera;
    let framed = output::frame_scene(&scene.animation, asked.fov, args.size.size);
    View {
        eye: asked.eye.unwrap_or(framed.eye),
        look_at: asked.look_at.unwrap_or(framed.look_at),
        up: asked.up.unwrap_or(framed.up),
        light: asked.light.unwrap_or(framed.light),
        ..framed
    }
}

fn query<'a>(camera: &'a Camera, view: &View) -> Query<'a> {
    Query {
        rays: Rays::Camera(camera),
        kind: QueryKind::ClosestAndShadow { light: view.light },
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

/// Renders every frame and writes its files; one row each.
fn trace_all(
    args: &RenderArgs,
    (scene, camera, view): (&Scene, &Camera, &View),
    (todo, done): (Vec<Frame>, usize),
    session: &mut Session,
    (outputs, video, wanted): (&Outputs, Option<Video>, Wanted),
    (journals, notes): (&mut [(PathBuf, Journal)], Option<&mut Notes>),
) -> Result<Vec<FrameStats>, Stop> {
    let progress = Progress::new(todo.len() as u64, args.quiet);
    for remark in session.remarks.iter().chain(&scene.facts.notes) {
        progress.say(remark);
    }
    if done > 0 {
        let all = done + todo.len();
        progress.say(&format!("{done} of {all} frames are there already"));
    }
    let query = query(camera, view);
    let done = Done::new(journals, notes, progress);
    let writer = Writer::new((scene, camera, view.light), (outputs, video, wanted), done);
    let mut places = 0..;
    rayon::in_place_scope(|scope| {
        session
            .driver
            .run::<Stop>(todo, query, wanted, |frame, answers| {
                writer.take(scope, places.next().unwrap_or_default(), frame, answers)
            })
    })?;
    writer.rows()
}

fn results(args: &RenderArgs, scene: &Scene, session: &Session, rows: &[FrameStats]) -> String {
    let [width, height] = args.size.size;
    let mut text = format!(
        "{}: {} ({} moving), {}; {} of {width}x{height}\n{}\n",
        scene.name,
        table::counted(scene.animation.triangle_count(), table::TRIANGLES),
        table::grouped(scene.animation.moving_count()),
        table::counted(scene.animation.key_count(), table::KEY_FRAMES),
        table::counted(rows.len(), table::FRAMES),
        session.caption(),
    );
    if !rows.is_empty() {
        text += &table::stages(rows);
        text += &table::trees(rows);
        text += &table::memory(rows);
        text += &table::rates(rows, width as usize * height as usize);
    }
    if !args.no_images {
        text += &format!("pictures: {}\n", args.out.display());
    }
    text
}

fn stats(args: &RenderArgs, scene: &Scene, session: &Session, rows: &[FrameStats]) -> Stats {
    let device = &session.device;
    Stats {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command_line: record::command_line(),
        scene: record::scene_facts(scene),
        backend: device.backend.to_owned(),
        adapter: device.adapter.clone(),
        driver: (!device.driver.is_empty()).then(|| device.driver.clone()),
        threads: session.threads.render,
        builder_threads: session.threads.build,
        update: session.update.name().to_owned(),
        lockstep: choose::lockstep(session.update),
        predict: session.predict,
        intersector: session.method[0].to_owned(),
        layout: session.method[1].to_owned(),
        auto: session.taken.clone(),
        size: args.size.size,
        frames: rows.to_vec(),
        summary: output::overview(rows),
    }
}

/// The primary rays, row by row.
#[derive(Clone)]
struct Pixels<'a> {
    camera: &'a Camera,
    next: std::ops::Range<usize>,
}

impl<'a> Pixels<'a> {
    fn new(camera: &'a Camera) -> Self {
        let next = 0..camera.pixels();
        Self { camera, next }
    }
}

impl Iterator for Pixels<'_> {
    type Item = geom::Ray;

    fn next(&mut self) -> Option<geom::Ray> {
        let i = self.next.next()?;
        let width = self.camera.width as usize;
        Some(self.camera.ray((i % width) as u32, (i / width) as u32))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.next.size_hint()
    }
}

impl ExactSizeIterator for Pixels<'_> {}
