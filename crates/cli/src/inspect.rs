//! `abvh inspect`: a scene's size and motion, how refitting decays, and what `auto` takes.

use crate::args::{BackendName, InspectArgs, IntersectorName, LayoutName, MethodArgs, UpdateName};
use crate::bench::FOV;
use crate::choose::{Ask, Run};
use crate::stop::Stop;
use crate::table::{KEY_FRAMES, TRIANGLES, counted, grouped, of_rows};
use crate::{frames, memory, reduce, session, talk};
use geom::Animation;
use output::Taken;
use pipeline::{Decay, Motion, Spread};
use scene::Scene;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Times at which the first tree is compared with a fresh one.
const SAMPLES: usize = 5;
/// Pixels of a frame of `render`, unless asked otherwise.
const SIZE: [u32; 2] = [1280, 720];

#[derive(Serialize)]
struct Inspection {
    scene: Value,
    bounds: Option<Value>,
    motion: Motion,
    inactive: Spread,
    degenerate: Spread,
    decay: Vec<Decay>,
    auto: Vec<Taken>,
}

pub(crate) fn run(args: &InspectArgs) -> Result<(), Stop> {
    if let Some(tolerance) = args.reduce_keys {
        return reduce::run(args, tolerance);
    }
    let options = memory::with_run(args.source.options(), 0);
    let scene = scene::open(&args.scene, &options)?;
    memory::check_trees(scene.animation.triangle_count(), 0)?;
    let animation = &scene.animation;
    let [inactive, degenerate] = pipeline::unhittable(animation).map_err(Stop::bad)?;
    let bounds = animation.bounds();
    let inspection = Inspection {
        scene: scene_facts(&scene),
        bounds: (!bounds.is_empty()).then(|| json!({ "min": bounds.min, "max": bounds.max })),
        motion: pipeline::motion(animation).map_err(Stop::bad)?,
        inactive,
        degenerate,
        decay: pipeline::decay(animation, SAMPLES).map_err(Stop::failed)?,
        auto: what_auto_takes(args, animation)?,
    };
    match args.json {
        true => talk::print_json(&inspection),
        false => talk::print(&text(&scene, &inspection)),
    }
}

/// What `render` would take if all were left to `auto`.
fn what_auto_takes(args: &InspectArgs, animation: &Arc<Animation>) -> Result<Vec<Taken>, Stop> {
    let is_demo = frames::is_demo(&args.scene);
    let frames = frames::list(None, None, animation.whole_times(), is_demo)?;
    let view = output::frame_scene(animation, FOV, SIZE);
    let camera = view.camera(SIZE);
    let run = camera.as_ref().map(|camera| Run {
        frames: &frames,
        query: view.query(camera),
    });
    let method = MethodArgs::of(IntersectorName::Auto, LayoutName::Auto);
    let ask = Ask {
        tolerance: args.tolerance.ppm(),
        run,
        ..Ask::of(BackendName::Auto, method, UpdateName::Auto)
    };
    Ok(session::start(animation, &ask)?.setup.auto)
}

fn text(scene: &Scene, i: &Inspection) -> String {
    let (animation, m) = (&scene.animation, &i.motion);
    let mut text = format!(
        "{}: {} ({} live, {} moving), {}, {}\n",
        scene.name,
        counted(animation.triangle_count(), TRIANGLES),
        grouped(animation.live_count()),
        grouped(animation.moving_count()),
        counted(animation.vertex_count(), ["vertex", "vertices"]),
        counted(animation.key_count(), KEY_FRAMES)
    );
    let bounds = animation.bounds();
    text += &match bounds.is_empty() {
        false => format!("bounds: {:?} to {:?}\n", bounds.min, bounds.max),
        true => "bounds: none, no vertex is finite\n".to_owned(),
    };
    text += &format!(
        "motion: {:.1}% of the vertices move; a key step is {:.3}% of the diagonal in the mean, {:.3}% at most\n",
        100.0 * m.moving,
        100.0 * m.mean_step,
        100.0 * m.max_step
    );
    for (what, n) in [("inactive", i.inactive), ("degenerate", i.degenerate)] {
        text += &format!("{what}: {} to {} triangles a key frame\n", n.min, n.max);
    }
    text += &decay_table(&i.decay);
    for t in &i.auto {
        text += &format!("{t}\n");
    }
    let notes = scene.facts.notes.iter();
    notes.for_each(|n| text += &format!("note: {n}\n"));
    text
}

fn decay_table(decay: &[Decay]) -> String {
    let row = |d: &Decay| {
        let ratio = d.ratio.map_or("-".to_owned(), |r| format!("{r:.3}"));
        vec![
            ("time", format!("{:.2}", d.time)),
            ("first tree refitted", format!("{:.2}", d.refitted)),
            ("fresh tree", format!("{:.2}", d.fresh)),
            ("SAH ratio", ratio),
        ]
    };
    of_rows(&decay.iter().map(row).collect::<Vec<_>>(), 0)
}

/// What was rendered, and what else its source told. `live` triangles are active in some key frame. Those that never move
/// are interpolated, preprocessed and refitted once.
pub(crate) fn scene_facts(scene: &Scene) -> Value {
    let (animation, facts) = (&scene.animation, &scene.facts);
    json!({
        "name": scene.name,
        "keys": animation.key_count(),
        "vertices": animation.vertex_count(),
        "triangles": animation.triangle_count(),
        "live": animation.live_count(),
        "moving": animation.moving_count(),
        "facts": {
            "format": facts.format,
            "files": facts.files.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>(),
            "clip": facts.clip,
            "seconds_per_key": facts.seconds_per_key,
            "notes": facts.notes,
        },
    })
}
