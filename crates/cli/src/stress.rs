//! `abvh stress`: streams a scene's vertices through the library step by step, times the steps and checks their hits.

use crate::args::{BackendChoice, RaysName, StressArgs, UpdateName, backend_name, update_name};
use crate::bench::{FOV, random_rays};
use crate::conflicts::Files;
use crate::stop::Stop;
use crate::table::{Cells, counted, table};
use crate::talk::{self, Progress};
use crate::{info, values};
use abvh::{
    Builder, Device, Intersector, Mesh, MeshId, Query, QueryId, Ray, SceneHit, Source, StepId,
    Tracer,
};
use backend::{BackendName, Policy};
use geom::{Animation, Camera, Point};
use scene::Scene;
use serde::Serialize;
use serde_json::json;
use std::time::{Duration, Instant};

/// Number of steps before the first timed one: they compile kernels and build the first tree.
const WARM_UP_STEPS: usize = 50;

/// Number of poses whose hits are compared with the host's.
const CHECKED_POSES: usize = 8;

pub(crate) fn run(args: &StressArgs) -> Result<(), Stop> {
    Files::written(&[("--json", &args.test.json)]).check(std::slice::from_ref(&args.scene))?;
    let scene = scene::open(
        &args.scene,
        &args.source.options_of_run(values::pixels(args.size)),
    )?;
    let motion = Motion::new(&scene, args)?;
    let runs = runs(args)?;
    let expected = motion.expected_hits()?;
    let mut progress = Progress::new(runs.len() as u64, args.test.quiet);
    let mut rows = Vec::new();
    for run in &runs {
        rows.push(run.measure(&motion, &expected, args.steps)?);
        progress.step(&[run.backend, run.update.name(), run.source.name()].join(" "));
    }
    drop(progress);
    if let Some(file) = &args.test.json {
        let report = json!({
            "schema": output::SCHEMA,
            "version": env!("CARGO_PKG_VERSION"),
            "command_line": info::command_line(),
            "scene": args.scene,
            "triangles": scene.animation.triangle_count(),
            "rays": motion.rays.count(),
            "poses": motion.poses.len(),
            "rows": rows,
        });
        output::write_json(file, &report)?;
    }
    let triangles = counted(scene.animation.triangle_count(), ["triangle", "triangles"]);
    let rays = counted(motion.rays.count(), ["ray", "rays"]);
    let head = format!("{}: {triangles}, {rays} a step, times in ms\n", args.scene);
    talk::print(&(head + &table(rows.iter().map(Row::cells), 3)))?;
    let wrong: u64 = rows.iter().map(|row| row.wrong).sum();
    if wrong > 0 {
        return Err(Stop::failed(format!("{wrong} hits differ from the host's")));
    }
    Ok(())
}

/// Positions and rays that every run uses.
struct Motion<'a> {
    animation: &'a Animation,
    /// Vertex positions, played forwards and backwards.
    poses: Vec<Vec<Point>>,
    rays: StepRays,
}

/// A submitted step.
struct Submitted {
    id: StepId,
    query: QueryId,
    /// Milliseconds of wall time from the start of the step, without the program's own writes.
    ms: f64,
}

/// The rays of each step.
enum StepRays {
    Camera(Box<Camera>),
    List(Vec<Ray>),
}

impl StepRays {
    fn count(&self) -> usize {
        match self {
            Self::Camera(camera) => camera.pixels(),
            Self::List(rays) => rays.len(),
        }
    }
}

impl<'a> Motion<'a> {
    fn new(scene: &'a Scene, args: &StressArgs) -> Result<Self, Stop> {
        let animation = &*scene.animation;
        let framed = shading::frame_scene(animation, FOV, args.size);
        let rays = match args.rays {
            RaysName::Random => {
                StepRays::List(random_rays(&animation.bounds(), values::pixels(args.size)))
            }
            RaysName::Camera => {
                let camera = framed.camera(args.size);
                let camera = camera.ok_or_else(|| Stop::bad("no camera frames this scene"))?;
                StepRays::Camera(Box::new(camera))
            }
        };
        let last = (args.poses - 1).max(1) as f64;
        let pose = |i: usize| -> Result<Vec<Point>, Stop> {
            let time = animation.end() * i as f64 / last;
            let moment = animation.at(time).map_err(Stop::failed)?;
            let vertices = 0..animation.vertex_count() as u32;
            Ok(vertices.map(|v| moment.vertex(v)).collect())
        };
        let poses = (0..args.poses).map(pose).collect::<Result<_, _>>()?;
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

    /// Builds a tracer with this scene as one streamed mesh.
    fn tracer(&self, builder: Builder) -> Result<(Tracer, MeshId), Stop> {
        let mut scene = abvh::Scene::new();
        let mesh = scene.add(Mesh::streamed(&self.poses[0], self.animation.triangles())?);
        Ok((builder.build(scene)?, mesh))
    }

    /// Submits one step that moves the mesh to a pose.
    fn step(
        &self,
        tracer: &mut Tracer,
        mesh: MeshId,
        pose: usize,
        source: Vertices,
    ) -> Result<Submitted, Stop> {
        let vertices = &self.poses[pose];
        let begun = Instant::now();
        let mut writing = Duration::ZERO;
        let mut step = tracer.step(0.0);
        match source {
            Vertices::Copied => step.vertices(mesh, Source::Host(vertices))?,
            Vertices::InPlace => {
                let to = step.vertices_mut(mesh)?;
                let writes = Instant::now();
                to.copy_from_slice(vertices);
                writing = writes.elapsed();
            }
        }
        let query = match &self.rays {
            StepRays::Camera(camera) => step.trace(&**camera, Query::Closest)?,
            StepRays::List(rays) => step.trace(rays, Query::Closest)?,
        };
        let id = step.submit()?;
        let ms = (begun.elapsed() - writing).as_secs_f64() * 1e3;
        Ok(Submitted { id, query, ms })
    }

    /// Traces one step and returns its hits.
    fn hits(
        &self,
        tracer: &mut Tracer,
        mesh: MeshId,
        pose: usize,
        source: Vertices,
    ) -> Result<Vec<SceneHit>, Stop> {
        let Submitted { id, query, .. } = self.step(tracer, mesh, pose, source)?;
        Ok(tracer.hits(id, query)?.in_scene().to_vec())
    }

    /// Returns the hits of the checked poses, traced on the host with a new tree for each pose.
    fn expected_hits(&self) -> Result<Vec<Vec<SceneHit>>, Stop> {
        let host = Tracer::builder().device(Device::Cpu);
        let (mut tracer, mesh) = self.tracer(host.update(Policy::Rebuild))?;
        self.checked()
            .map(|pose| self.hits(&mut tracer, mesh, pose, Vertices::Copied))
            .collect()
    }
}

/// How a step's vertices reach the tracer.
#[derive(Clone, Copy)]
enum Vertices {
    /// Copied from the program's memory.
    Copied,
    /// Written by the program to memory that the device reads.
    InPlace,
}

impl Vertices {
    fn name(self) -> &'static str {
        match self {
            Self::Copied => "copied",
            Self::InPlace => "in place",
        }
    }
}

/// Returns the policy of a run, if `stress` measures it: one whose trees the host builds.
fn policy(name: UpdateName) -> Result<Policy, Stop> {
    let builds_on_host = |policy: &Policy| !policy.builds_on_device();
    name.filter(builds_on_host).ok_or_else(|| {
        let known: Vec<_> = Policy::ALL.into_iter().filter(builds_on_host).collect();
        let known: Vec<_> = known.into_iter().map(Policy::name).collect();
        let (name, known) = (update_name(name), known.join(", "));
        Stop::bad(format!("--update {name}: stress takes {known}"))
    })
}

/// One row of the table.
struct Run {
    backend: &'static str,
    device: Device,
    update: Policy,
    source: Vertices,
}

fn runs(args: &StressArgs) -> Result<Vec<Run>, Stop> {
    let mut runs = Vec::new();
    for &name in &args.test.backend {
        let device = device(name, args.test.adapter.as_deref())?;
        for &update in &args.update {
            let update = policy(update)?;
            runs.extend([Vertices::Copied, Vertices::InPlace].map(|source| Run {
                backend: backend_name(name),
                device: device.clone(),
                update,
                source,
            }));
        }
    }
    Ok(runs)
}

/// Returns the library's device for a backend, or an error if this build or the library lacks the backend.
#[cfg_attr(
    not(any(feature = "vulkan", feature = "wgpu")),
    allow(unused_variables, reason = "only GPUs have adapters to choose from")
)]
fn device(name: BackendChoice, adapter: Option<&str>) -> Result<Device, Stop> {
    match name {
        None => Ok(Device::Auto),
        Some(BackendName::Cpu) => Ok(Device::Cpu),
        Some(BackendName::CpuRef) => Ok(Device::CpuRef),
        #[cfg(feature = "vulkan")]
        Some(BackendName::Vulkan) => Ok(Device::Vulkan(adapter.map(str::to_owned))),
        #[cfg(feature = "wgpu")]
        Some(BackendName::Wgpu) => Ok(Device::Wgpu(adapter.map(str::to_owned))),
        #[cfg(not(all(feature = "vulkan", feature = "wgpu")))]
        other => Err(Stop::bad(format!(
            "{} is not in this build",
            backend_name(other)
        ))),
    }
}

#[derive(Serialize)]
struct Row {
    backend: String,
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

impl Row {
    fn cells(&self) -> Cells<'_> {
        let ms = |ms: f64| format!("{ms:.3}");
        vec![
            ("backend", self.backend.clone()),
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

impl Run {
    fn measure(
        &self,
        motion: &Motion<'_>,
        expected: &[Vec<SceneHit>],
        steps: usize,
    ) -> Result<Row, Stop> {
        let builder = Tracer::builder().device(self.device.clone());
        let builder = builder
            .update(self.update)
            .intersector(Intersector::Watertight);
        let (mut tracer, mesh) = motion.tracer(builder)?;
        let mut times = Vec::with_capacity(steps);
        for step in 0..WARM_UP_STEPS + steps {
            let pose = motion.pose_of(step);
            let submitted = motion.step(&mut tracer, mesh, pose, self.source)?;
            if step >= WARM_UP_STEPS {
                times.push(submitted.ms);
            }
        }
        let trees = tracer
            .statistics()
            .map_or(0, |s| s.generation.saturating_sub(1));
        let (mut checked, mut wrong) = (0, 0);
        for (pose, expected) in motion.checked().zip(expected) {
            let hits = motion.hits(&mut tracer, mesh, pose, self.source)?;
            checked += hits.len();
            wrong += hits.iter().zip(expected).filter(|(a, b)| a != b).count() as u64;
        }
        times.sort_by(f64::total_cmp);
        let share = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
        Ok(Row {
            backend: self.backend.to_owned(),
            device: tracer.device().to_owned(),
            update: self.update.name(),
            vertices: self.source.name(),
            steps,
            mean_ms: times.iter().sum::<f64>() / times.len() as f64,
            median_ms: share(0.5),
            p99_ms: share(0.99),
            worst_ms: share(1.0),
            trees,
            checked,
            wrong,
        })
    }
}
