//! `abvh trace`: traces rays from a file against the scene at a given time.

use crate::command::{Requirement, RunCommand};
use crate::console;
use crate::devices::{BackendChoice, DeviceSettings};
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::frame_list;
use crate::parsers;
use crate::scene_source::{self, SceneSettings};
use crate::setup::{self, Started};
use crate::table::counted;
use crate::tracer_settings::{PolicyChoice, TracerSettings, Workload, needs_host_builds};
use abvh::Query;
use backend::{Intersector, Policy};
use clap::Args;
use output::HitArrays;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct TraceSettings {
    /// Scene: a demo, files or a directory (`abvh render --help` explains names)
    #[arg(value_parser = parsers::scene())]
    scene: String,
    #[command(flatten)]
    source: SceneSettings,
    /// Time, in key frames
    #[arg(long, value_name = "T", value_parser = parsers::finite::<f64>, allow_hyphen_values = true)]
    time: f64,
    /// Rays: float32 or float64 (N, 6) `ox oy oz dx dy dz`, or (N, 8) with `t_min t_max` appended
    #[arg(long, value_name = "RAYS.npy")]
    rays: PathBuf,
    /// File for the hits
    #[arg(long, value_name = "HITS.npz", value_parser = parsers::file())]
    out: PathBuf,
    /// Report only whether each ray hits any triangle
    #[arg(long)]
    any_hit: bool,
    /// Backend
    #[arg(long, value_name = "NAME", default_value = parsers::AUTO, value_parser = parsers::backend("The best available backend"))]
    backend: BackendChoice,
    #[command(flatten)]
    device: DeviceSettings,
    /// How a ray is tested against a triangle
    #[arg(long, value_name = "NAME", default_value = "watertight", value_parser = parsers::intersector())]
    intersector: Intersector,
    /// How the tree is made. refit builds it for --tree-time and refits it to --time. The other policies build it for
    /// --time. The hits are the same; only the speed differs
    #[arg(long, value_name = "POLICY", default_value = parsers::AUTO, value_parser = parsers::update(|p| !p.builds_concurrently()))]
    update: PolicyChoice,
    /// With --update refit: time at which the tree is built, in key frames [default: 0]
    #[arg(long, value_name = "T0", value_parser = parsers::finite::<f64>, allow_hyphen_values = true)]
    tree_time: Option<f64>,
    /// Print no remarks
    #[arg(long, short)]
    quiet: bool,
}

impl RunCommand for TraceSettings {
    fn run(&self) -> Result<(), CliError> {
        let files = CommandFiles {
            read: vec![("--rays", self.rays.clone())],
            written: vec![("--out", self.out.clone())],
            ..CommandFiles::default()
        };
        files.check(std::slice::from_ref(&self.scene))?;
        let tracer = self.tracer();
        let opening = setup::begin(&tracer);
        let file = output::RayFile::open(&self.rays).map_err(CliError::invalid)?;
        let scene = self.source.open(&self.scene, file.count())?;
        let offset = scene.facts.offset;
        let rays = file
            .read(offset.unwrap_or_default())
            .map_err(CliError::invalid)?;
        let keys = scene.animation.key_count();
        let time = frame_list::check_time("--time", self.time, keys)?;
        let tree_time = match self.update {
            Some(Policy::Refit) => {
                let time = self.tree_time.unwrap_or(0.0);
                Some(frame_list::check_time("--tree-time", time, keys)?)
            }
            _ => None,
        };
        let query = if self.any_hit {
            Query::Any
        } else {
            Query::Closest
        };
        let workload = Workload {
            frames: &[],
            rays: rays.len(),
        };
        let Started { mut tracer, setup } =
            setup::start_tracer(&scene, &tracer, workload, opening)?;
        if !self.quiet {
            setup.auto.iter().for_each(|t| console::say(&t.to_string()));
            scene.facts.notes.iter().for_each(|note| console::say(note));
        }
        if let Some(time) = tree_time {
            tracer.warm_up(time)?;
        }
        let mut step = tracer.step(time);
        let query = step.trace(&rays, query)?;
        let done = step.submit()?;
        let hits = tracer.hits(done, query)?;
        if self.any_hit {
            output::write_any_hits(&self.out, hits.any())?;
        } else {
            let shape = [rays.len() as u64];
            let hits = HitArrays {
                offset,
                ..HitArrays::of(hits.in_scene(), &shape)
            };
            hits.write(&self.out)?;
        }
        let closest = hits.in_scene().iter().filter(|h| h.is_hit()).count();
        let any = hits.any().iter().filter(|&&b| b != 0).count();
        let caption = &setup.caption;
        let rays = counted(rays.len(), ["ray", "rays"]);
        let met = counted(closest + any, ["hit", "hits"]);
        console::print(&format!("{rays}, {met} at time {time}\n{caption}\n"))
    }

    fn requirements(&self) -> Vec<Requirement> {
        let mut all = vec![
            Requirement::new(
                "tree_time",
                self.update == Some(Policy::Refit),
                "applies only with --update refit",
            ),
            needs_host_builds(&[self.update]),
        ];
        all.extend(scene_source::requirements(&[&self.scene]));
        all
    }

    fn threads(&self) -> Option<usize> {
        self.device.threads
    }
}

impl TraceSettings {
    fn tracer(&self) -> TracerSettings {
        let update = self.update.unwrap_or(Policy::Rebuild);
        TracerSettings {
            device: self.device.clone(),
            ..TracerSettings::of(self.backend, self.intersector, Some(update))
        }
    }
}
