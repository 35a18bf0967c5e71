//! `abvh inspect`: a scene's size and motion, how refitting decays, and what `auto` takes.

mod motion;

use crate::args::{
    BackendName, InspectArgs, IntersectorName, LayoutName, MethodArgs, Switch, UpdateName,
};
use crate::bench::FOV;
use crate::choose::{self, Ahead, Ask, Run};
use crate::stop::Stop;
use crate::table::{KEY_FRAMES, TRIANGLES, counted, grouped, of_rows};
use crate::{frames, memory, record, reduce, session, talk};
use backend::{Query, QueryKind, Rays};
use geom::Animation;
use motion::{Decay, Motion, Spread, Still};
use output::{SceneFacts, Taken};
use serde::Serialize;
use std::sync::Arc;

/// Times at which the first tree is compared with a fresh one.
const SAMPLES: usize = 5;
/// Pixels of a frame of `render`, unless asked otherwise.
const SIZE: [u32; 2] = [1280, 720];

#[derive(Serialize)]
struct Inspection {
    scene: SceneFacts,
    bounds: Option<Bounds>,
    motion: Motion,
    #[serde(rename = "static")]
    still: Still,
    inactive: Spread,
    degenerate: Spread,
    decay: Vec<Decay>,
    auto: Vec<Taken>,
}

#[derive(Serialize)]
struct Bounds {
    min: [f32; 3],
    max: [f32; 3],
}

pub(crate) fn run(args: &InspectArgs) -> Result<(), Stop> {
    if let Some(tolerance) = args.reduce_keys {
        return reduce::run(args, tolerance);
    }
    let options = memory::with_run(args.source.options(), 0);
    let scene = scene::open(&args.scene, &options)?;
    memory::check_trees(scene.animation.triangle_count(), 0)?;
    let animation = &scene.animation;
    let bounds = animation.bounds();
    let [inactive, degenerate] = motion::unhittable(animation).map_err(Stop::bad)?;
    let inspection = Inspection {
        scene: record::scene_facts(&scene),
        bounds: (!bounds.is_empty()).then_some(Bounds {
            min: bounds.min,
            max: bounds.max,
        }),
        motion: motion::measure(animation).map_err(Stop::bad)?,
        still: motion::still(animation),
        inactive,
        degenerate,
        decay: motion::decay(animation, SAMPLES).map_err(Stop::failed)?,
        auto: what_auto_takes(args, animation)?,
    };
    if args.json {
        talk::print_json(&inspection)
    } else {
        talk::print(&text(&inspection, &scene.facts.notes))
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
        query: Query {
            rays: Rays::Camera(camera),
            kind: QueryKind::ClosestAndShadow { light: view.light },
        },
    });
    let method = MethodArgs {
        intersector: IntersectorName::Auto,
        layout: LayoutName::Auto,
    };
    let ask = Ask {
        tolerance: args.tolerance.ppm(),
        run,
        ahead: Ahead::of(&frames, Switch::On),
        ..Ask::of(
            BackendName::Auto,
            method,
            choose::free_update(UpdateName::Auto),
        )
    };
    Ok(session::start(animation, &ask)?.taken)
}

fn text(i: &Inspection, notes: &[String]) -> String {
    let (s, m) = (&i.scene, &i.motion);
    let mut text = format!(
        "{}: {} ({} live), {}, {}\n",
        s.name,
        counted(s.triangles, TRIANGLES),
        grouped(s.live),
        counted(s.vertices, ["vertex", "vertices"]),
        counted(s.keys, KEY_FRAMES)
    );
    text += &match &i.bounds {
        Some(b) => format!("bounds: {:?} to {:?}\n", b.min, b.max),
        None => "bounds: none, no vertex is finite\n".to_owned(),
    };
    text += &format!(
        "motion: {:.1}% of the vertices move; a key step is {:.3}% of the diagonal in the mean, {:.3}% at most\n",
        100.0 * m.moving,
        100.0 * m.mean_step,
        100.0 * m.max_step
    );
    let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
    let still = &i.still;
    text += &format!(
        "static: {:.1}% of the vertices, {:.1}% of the triangles; {} of {} bytes of positions repeat the first key frame\n",
        percent(still.vertices, s.vertices),
        percent(still.triangles, s.triangles),
        grouped(still.repeated_bytes),
        grouped(still.bytes)
    );
    for (what, n) in [("inactive", i.inactive), ("degenerate", i.degenerate)] {
        text += &format!("{what}: {} to {} triangles a key frame\n", n.min, n.max);
    }
    text += &decay_table(&i.decay);
    for t in &i.auto {
        text += &format!("{t}\n");
    }
    notes.iter().for_each(|n| text += &format!("note: {n}\n"));
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
