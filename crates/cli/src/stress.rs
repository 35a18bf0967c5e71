//! `abvh stress`: streams a scene's vertices through the library step by step, times the steps and checks their hits.

use crate::camera::CameraSettings;
use crate::command::{Requirement, RunCommand};
use crate::console::{self, ProgressLine};
use crate::devices::{BackendChoice, DeviceSettings, backend_name};
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::machine::{self, VERSION};
use crate::measure::{FrameRays, MeasuredRays};
use crate::parsers;
use crate::scene_source::{self, SceneSettings};
use crate::table::{Cells, TRIANGLES, counted, ms, table};
use crate::tested_backends::TestSettings;
use crate::tracer_settings::TracerSettings;
use abvh::{Mesh, MeshId, Query, QueryId, SceneHit, Source, StepId, Tracer};
use backend::{BackendName, Intersector, Policy};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use geom::{Animation, Point};
use output::Summary;
use serde::Serialize;
use serde_json::json;
use std::time::{Duration, Instant};

/// Number of steps before the first timed one: they compile kernels and build the first tree.
const WARM_UP_STEPS: usize = 50;

/// Maximum number of poses whose hits are compared with the host's.
const CHECKED_POSES: usize = 8;

#[derive(Args, Debug)]
#[command(mut_arg("size", |arg| arg.default_value("640x480")))]
pub(crate) struct StressSettings {
    /// Scene whose motion is streamed; `abvh render --help` explains how scenes are named
    #[arg(default_value = "demo:collide", value_parser = parsers::scene())]
    scene: String,
    #[command(flatten)]
    source: SceneSettings,
    #[command(flatten)]
    test: TestSettings,
    /// Update policies
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "async,refit", value_parser = parsers::policy(|p| !p.builds_on_device()))]
    update: Vec<Policy>,
    /// Timed steps of each run
    #[arg(long, value_name = "N", default_value = "1000",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=10_000_000))]
    steps: usize,
    /// Number of poses over the whole motion, played forwards and backwards; fewer poses give faster motion
    #[arg(long, value_name = "N", default_value = "256",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    poses: usize,
    /// Rays of a step: a camera's, or as many random rays from points in the scene's bounds
    #[arg(long, value_name = "NAME", default_value = "camera")]
    rays: MeasuredRays,
    #[command(flatten)]
    camera: CameraSettings,
}

impl RunCommand for StressSettings {
    fn run(&self) -> Result<(), CliError> {
        let scenes = std::slice::from_ref(&self.scene);
        CommandFiles::written(&[("--json", &self.test.json)]).check(scenes)?;
        let scene = (self.source).open(&self.scene, self.camera.pixels())?;
        let lit_camera = self.camera.aim(&scene)?;
        let rays = FrameRays::of(self.rays, &scene, &lit_camera);
        let motion = StreamedMotion::new(&scene.animation, self.poses, rays)?;
        let runs = self.runs();
        let expected = motion.expected_hits()?;
        let mut progress = ProgressLine::new(runs.len() as u64, self.test.quiet);
        let mut rows = Vec::new();
        for run in &runs {
            rows.push(run.measure(&motion, &expected, self.steps)?);
            let backend = backend_name(run.backend);
            progress.step(&[backend, run.update.name(), run.source.name()].join(" "));
        }
        drop(progress);
        if let Some(file) = &self.test.json {
            let report = json!({
                "schema": output::SCHEMA,
                "version": VERSION,
                "command_line": machine::command_line(),
                "scene": self.scene,
                "triangles": scene.animation.triangle_count(),
                "rays": self.camera.pixels(),
                "poses": motion.poses.len(),
                "rows": rows,
            });
            output::write_json(file, &report)?;
        }
        let triangles = counted(scene.animation.triangle_count(), TRIANGLES);
        let rays = counted(self.camera.pixels(), ["ray", "rays"]);
        let head = format!("{}: {triangles}, {rays} a step, times in ms\n", self.scene);
        console::print(&(head + &table(rows.iter().map(StressRow::cells), 3)))?;
        match rows.iter().map(|row| row.wrong).sum::<u64>() {
            0 => Ok(()),
            wrong => Err(CliError::failed(format!(
                "{wrong} hits differ from the host's"
            ))),
        }
    }

    fn requirements(&self) -> Vec<Requirement> {
        scene_source::requirements(&[&self.scene])
    }
}

impl StressSettings {
    fn runs(&self) -> Vec<StressRun> {
        let mut runs = Vec::new();
        for &backend in &self.test.backend {
            let device = DeviceSettings {
                adapter: self.test.adapter.clone(),
                ..DeviceSettings::default()
            };
            for &update in &self.update {
                let sources = [VertexSource::Copied, VertexSource::InPlace];
                runs.extend(sources.map(|source| StressRun {
                    backend,
                    device: device.clone(),
                    update,
                    source,
                }));
            }
        }
        runs
    }
}

/// Positions and rays that every run uses.
struct StreamedMotion<'a> {
    animation: &'a Animation,
    /// Vertex positions, played forwards and backwards.
    poses: Vec<Vec<Point>>,
    rays: FrameRays<'a>,
}

/// A submitted step.
struct SubmittedStep {
    id: StepId,
    query: QueryId,
    /// Wall time from the start of the step to its submission, in milliseconds, without the program's writes of
    /// vertices.
    ms: f64,
}

impl<'a> StreamedMotion<'a> {
    fn new(animation: &'a Animation, poses: usize, rays: FrameRays<'a>) -> Result<Self, CliError> {
        check_poses(poses, animation.vertex_count())?;
        let last = (poses - 1).max(1) as f64;
        let pose = |i: usize| -> Result<Vec<Point>, CliError> {
            let time = animation.end() * i as f64 / last;
            let moment = animation.at(time).map_err(CliError::failed)?;
            let vertices = 0..animation.vertex_count() as u32;
            Ok(vertices.map(|v| moment.vertex(v)).collect())
        };
        let poses = (0..poses).map(pose).collect::<Result<_, _>>()?;
        Ok(Self {
            animation,
            poses,
            rays,
        })
    }

    /// Returns the index of a step's pose: forwards, then backwards.
    fn pose_of(&self, step: usize) -> usize {
        let last = self.poses.len() - 1;
        let period = (2 * last).max(1);
        let at = step % period;
        at.min(period - at)
    }

    /// Returns the indices of the poses whose hits are checked.
    fn checked(&self) -> impl Iterator<Item = usize> {
        let stride = self.poses.len().div_ceil(CHECKED_POSES);
        (0..self.poses.len()).step_by(stride)
    }

    /// Opens the device of a run, and loads this scene as one streamed mesh.
    fn start(&self, run: &StressRun) -> Result<StreamedTracer<'_>, CliError> {
        let settings = TracerSettings {
            device: run.device.clone(),
            ..TracerSettings::of(run.backend, Intersector::Watertight, Some(run.update))
        };
        let builder = Tracer::builder()
            .update(run.update)
            .intersector(settings.intersector);
        let mut scene = abvh::Scene::new();
        let mesh = scene.add(Mesh::streamed(&self.poses[0], self.animation.triangles())?);
        Ok(StreamedTracer {
            motion: self,
            tracer: builder.build_on(settings.device_to_open().open(run.backend)?, scene)?,
            mesh,
            source: run.source,
        })
    }

    /// Returns the hits of the checked poses, traced on the host with a new tree for each pose.
    fn expected_hits(&self) -> Result<Vec<Vec<SceneHit>>, CliError> {
        let mut tracer = self.start(&StressRun {
            backend: Some(BackendName::Cpu),
            device: DeviceSettings::default(),
            update: Policy::Rebuild,
            source: VertexSource::Copied,
        })?;
        self.checked().map(|pose| tracer.hits(pose)).collect()
    }
}

/// Refuses poses that exceed the host's free memory.
fn check_poses(poses: usize, vertices: usize) -> Result<(), CliError> {
    let pose_bytes = (vertices as u64).saturating_mul(size_of::<Point>() as u64);
    let checked = host::check_memory(pose_bytes.saturating_mul(poses as u64));
    checked.map_err(|e| {
        CliError::invalid(format!(
            "--poses {poses} of {vertices} vertices: {e}; use fewer poses"
        ))
    })
}

/// A tracer whose only mesh is streamed.
struct StreamedTracer<'a> {
    motion: &'a StreamedMotion<'a>,
    tracer: Tracer,
    mesh: MeshId,
    source: VertexSource,
}

impl StreamedTracer<'_> {
    /// Submits one step that moves the mesh to a pose.
    fn step(&mut self, pose: usize) -> Result<SubmittedStep, CliError> {
        let vertices = &self.motion.poses[pose];
        let begun = Instant::now();
        let mut writing = Duration::ZERO;
        let mut step = self.tracer.step(0.0);
        match self.source {
            VertexSource::Copied => step.vertices(self.mesh, Source::Host(vertices))?,
            VertexSource::InPlace => {
                let to = step.vertices_mut(self.mesh)?;
                let writes = Instant::now();
                to.copy_from_slice(vertices);
                writing = writes.elapsed();
            }
        }
        let query = match &self.motion.rays {
            FrameRays::Camera(lit_camera) => step.trace(&lit_camera.camera, Query::Closest)?,
            FrameRays::Random(rays) => step.trace(rays, Query::Closest)?,
        };
        let id = step.submit()?;
        let ms = (begun.elapsed() - writing).as_secs_f64() * 1e3;
        Ok(SubmittedStep { id, query, ms })
    }

    /// Traces one step and returns its hits.
    fn hits(&mut self, pose: usize) -> Result<Vec<SceneHit>, CliError> {
        let SubmittedStep { id, query, .. } = self.step(pose)?;
        Ok(self.tracer.hits(id, query)?.in_scene().to_vec())
    }
}

/// How a step's vertices reach the tracer.
#[derive(Clone, Copy)]
enum VertexSource {
    /// Copied from the program's memory.
    Copied,
    /// Written by the program to memory that the device reads.
    InPlace,
}

impl VertexSource {
    fn name(self) -> &'static str {
        match self {
            Self::Copied => "copied",
            Self::InPlace => "in place",
        }
    }
}

/// One combination of backend, update policy and vertex source.
struct StressRun {
    backend: BackendChoice,
    device: DeviceSettings,
    update: Policy,
    source: VertexSource,
}

#[derive(Serialize)]
struct StressRow {
    backend: &'static str,
    device: String,
    update: &'static str,
    vertices: &'static str,
    steps: usize,
    mean_ms: f64,
    median_ms: f64,
    p99_ms: f64,
    worst_ms: f64,
    /// Trees adopted after the first.
    trees: u64,
    checked: usize,
    wrong: u64,
}

impl StressRow {
    fn cells(&self) -> Cells<'_> {
        vec![
            ("backend", self.backend.to_owned()),
            ("update", self.update.to_owned()),
            ("vertices", self.vertices.to_owned()),
            ("mean", ms(self.mean_ms)),
            ("median", ms(self.median_ms)),
            ("p99", ms(self.p99_ms)),
            ("worst", ms(self.worst_ms)),
            ("trees", self.trees.to_string()),
            ("hits checked", self.checked.to_string()),
            ("wrong", self.wrong.to_string()),
        ]
    }
}

impl StressRun {
    fn measure(
        &self,
        motion: &StreamedMotion<'_>,
        expected: &[Vec<SceneHit>],
        steps: usize,
    ) -> Result<StressRow, CliError> {
        let mut tracer = motion.start(self)?;
        let mut times = Vec::with_capacity(steps);
        let (mut trees, mut generation) = (0_u64, None);
        for step in 0..WARM_UP_STEPS + steps {
            let submitted = tracer.step(motion.pose_of(step))?;
            if step >= WARM_UP_STEPS {
                times.push(submitted.ms);
            }
            let newest = tracer.tracer.statistics().map(|s| s.generation);
            trees += u64::from(newest > generation);
            generation = newest;
        }
        let (mut checked, mut wrong) = (0, 0);
        for (pose, expected) in motion.checked().zip(expected) {
            let hits = tracer.hits(pose)?;
            checked += hits.len();
            wrong += hits.iter().zip(expected).filter(|(a, b)| a != b).count() as u64;
        }
        times.sort_by(f64::total_cmp);
        let summary = Summary::of(times.iter().copied());
        let Summary { median, worst, .. } =
            summary.ok_or_else(|| CliError::failed("no step is timed"))?;
        Ok(StressRow {
            backend: backend_name(self.backend),
            device: tracer.tracer.device().to_owned(),
            update: self.update.name(),
            vertices: self.source.name(),
            steps,
            mean_ms: times.iter().sum::<f64>() / times.len() as f64,
            median_ms: median,
            p99_ms: times[(times.len() * 99).div_ceil(100) - 1],
            worst_ms: worst,
            trees: trees.saturating_sub(1),
            checked,
            wrong,
        })
    }
}

// On other systems the free memory is unknown.
#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use crate::error::INVALID;

    #[test]
    fn poses_must_fit_in_memory() {
        assert!(check_poses(2, 3).is_ok());
        let refused = check_poses(100_000, 1 << 40).unwrap_err();
        assert!(refused.code == INVALID && refused.to_string().contains("--poses"));
    }
}
