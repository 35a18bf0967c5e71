//! `abvh inspect`: describes a scene's size and motion, how refitted trees degrade, and the choices of `auto`.

use crate::camera::DEFAULT_PIXELS;
use crate::command::{Requirement, RunCommand};
use crate::console;
use crate::error::CliError;
use crate::frame_list;
use crate::parsers;
use crate::scene_source::{self, SceneSettings, is_demo, scene_facts};
use crate::setup;
use crate::table::{KEY_FRAMES, TRIANGLES, counted, format_count, table};
use crate::tracer_settings::{TracerSettings, Workload};
use backend::Intersector;
use clap::Args;
use output::AutoChoice;
use pipeline::{CountRange, MotionStats, RefitCosts};
use scene::Scene;
use serde::Serialize;
use serde_json::{Value, json};

/// Number of sample times at which the refitted first tree is compared with a new tree.
const SAMPLES: usize = 5;

#[derive(Args, Debug)]
pub(crate) struct InspectSettings {
    /// Scene: a demo, files or a directory (`abvh render --help` explains names)
    #[arg(value_parser = parsers::scene())]
    scene: String,
    #[command(flatten)]
    source: SceneSettings,
    /// Print JSON to standard output
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Inspection {
    scene: Value,
    bounds: Option<Value>,
    motion: MotionStats,
    inactive: CountRange,
    degenerate: CountRange,
    #[serde(rename = "decay")]
    refit_costs: Vec<RefitCosts>,
    auto: Vec<AutoChoice>,
}

impl RunCommand for InspectSettings {
    fn run(&self) -> Result<(), CliError> {
        let scene = self.source.open(&self.scene, 0)?;
        setup::check_trees(scene.animation.triangle_count(), 0)?;
        let animation = &scene.animation;
        let [inactive, degenerate] =
            pipeline::inactive_and_degenerate(animation).map_err(CliError::invalid)?;
        let bounds = animation.bounds();
        let inspection = Inspection {
            scene: scene_facts(&scene),
            bounds: (!bounds.is_empty()).then(|| json!({ "min": bounds.min, "max": bounds.max })),
            motion: pipeline::motion(animation).map_err(CliError::invalid)?,
            inactive,
            degenerate,
            refit_costs: pipeline::refit_costs(animation, SAMPLES).map_err(CliError::failed)?,
            auto: choices_of_auto(&self.scene, &scene)?,
        };
        if self.json {
            console::print_json(&inspection)
        } else {
            console::print(&text(&scene, &inspection))
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        scene_source::requirements(&[&self.scene])
    }
}

/// Returns what `render` would choose if everything were `auto`.
fn choices_of_auto(name: &str, scene: &Scene) -> Result<Vec<AutoChoice>, CliError> {
    let animation = &scene.animation;
    let frames = frame_list::list(None, None, animation.key_count(), is_demo(name))?;
    let settings = TracerSettings::of(None, Intersector::Watertight, None);
    let workload = Workload {
        frames: &frames,
        rays: DEFAULT_PIXELS,
    };
    Ok(setup::start_driver(animation, &settings, workload)?
        .setup
        .auto)
}

fn text(scene: &Scene, i: &Inspection) -> String {
    let (animation, m) = (&scene.animation, &i.motion);
    let mut text = format!(
        "{}: {} ({} live, {} moving), {}, {}\n",
        scene.name,
        counted(animation.triangle_count(), TRIANGLES),
        format_count(animation.live_count()),
        format_count(animation.moving_count()),
        counted(animation.vertex_count(), ["vertex", "vertices"]),
        counted(animation.key_count(), KEY_FRAMES)
    );
    let bounds = animation.bounds();
    text += &if bounds.is_empty() {
        "bounds: none, no vertex is finite\n".to_owned()
    } else {
        format!("bounds: {:?} to {:?}\n", bounds.min, bounds.max)
    };
    if let Some(offset) = scene.facts.offset {
        text += &format!("offset: {offset:?} is subtracted from all coordinates\n");
    }
    text += &format!(
        "motion: {:.1}% of the vertices move; mean step per key frame {:.3}% of the bounds' diagonal, maximum {:.3}%\n",
        100.0 * m.moving,
        100.0 * m.mean_step,
        100.0 * m.max_step
    );
    for (what, n) in [("inactive", i.inactive), ("degenerate", i.degenerate)] {
        text += &format!("{what}: {} to {} triangles per key frame\n", n.min, n.max);
    }
    text += &refit_table(&i.refit_costs);
    for t in &i.auto {
        text += &format!("{t}\n");
    }
    let notes = scene.facts.notes.iter();
    notes.for_each(|n| text += &format!("note: {n}\n"));
    text
}

fn refit_table(costs: &[RefitCosts]) -> String {
    let row = |c: &RefitCosts| {
        let ratio = c.ratio.map_or("-".to_owned(), |r| format!("{r:.3}"));
        vec![
            ("time", format!("{:.2}", c.time)),
            ("first tree refitted", format!("{:.2}", c.refitted)),
            ("fresh tree", format!("{:.2}", c.fresh)),
            ("SAH ratio", ratio),
        ]
    };
    table(costs.iter().map(row), 0)
}
