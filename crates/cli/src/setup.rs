//! Opens the device of a run, replaces options that are `auto` by chosen values, and loads the scene.
//!
//! `start_tracer` serves `render` and `trace`; `start_driver` serves `bench`, `chart` and `inspect`. The library's
//! tracer is built on the frame driver.

use crate::auto::{self, Capabilities};
use crate::devices::{DeviceSettings, Opening, Selected, SelectedBackend};
use crate::error::CliError;
use crate::tracer_settings::{TracerSettings, Workload};
use abvh::{Mesh, Tracer};
use backend::{Backend, BackendName, DeviceKind};
use geom::Animation;
use host::FreeMemory;
use output::AutoChoice;
use pipeline::{BuilderThreads, Driver, DriverOptions, ExpectedMemory, trees_and_rays_bytes};
use scene::Scene;
use serde::Serialize;
use std::sync::Arc;

/// Device, threads and settings of a run.
#[derive(Clone, Default, Serialize)]
pub(crate) struct Setup {
    pub(crate) backend: &'static str,
    pub(crate) adapter: String,
    /// Name and version of the device's driver, if there is one.
    pub(crate) driver: Option<String>,
    pub(crate) threads: usize,
    pub(crate) builder_threads: usize,
    pub(crate) update: &'static str,
    /// Fixed number of frames between the request and the adoption of a tree.
    pub(crate) lockstep: Option<u32>,
    /// With `async`: whether trees are built for predicted positions.
    pub(crate) predict: Option<bool>,
    pub(crate) intersector: &'static str,
    /// Choices of `auto`.
    pub(crate) auto: Vec<AutoChoice>,
    #[serde(skip)]
    pub(crate) memory: Option<ExpectedMemory>,
    /// The setup as one line of text.
    #[serde(skip)]
    pub(crate) caption: String,
}

/// A tracer or driver with its scene loaded, and how it was set up.
pub(crate) struct Started<T> {
    pub(crate) tracer: T,
    pub(crate) setup: Setup,
}

/// Starts to open the backend on another thread while the scene is read. Backends on the host open fast, so they are
/// opened later.
pub(crate) fn begin(settings: &TracerSettings) -> Opening {
    let is_on_host = settings.backend.is_some_and(BackendName::is_on_host);
    if is_on_host {
        Opening::default()
    } else {
        Opening::begin(settings.backend, settings.device_to_open())
    }
}

/// Waits for the backend, makes the choices of `auto`, and loads the scene into a tracer.
pub(crate) fn start_tracer(
    scene: &Scene,
    settings: &TracerSettings,
    workload: Workload<'_>,
    opening: Opening,
) -> Result<Started<Tracer>, CliError> {
    let opened = opening.wait().transpose()?;
    let load = |resolved: Resolved| {
        let mut scene_of_one = abvh::Scene::new();
        scene_of_one.add(Mesh::from(scene));
        let options = resolved.options;
        let builder = Tracer::builder()
            .update(options.update)
            .intersector(options.intersector)
            .time_range(options.time_range)
            .predict(options.predict)
            .builder_threads(resolved.setup.builder_threads);
        Ok(builder.build_on(resolved.backend, scene_of_one)?)
    };
    start(&scene.animation, settings, workload, opened, load)
}

/// Opens the backend, makes the choices of `auto`, and loads the scene into a driver.
pub(crate) fn start_driver(
    animation: &Arc<Animation>,
    settings: &TracerSettings,
    workload: Workload<'_>,
) -> Result<Started<Driver>, CliError> {
    let load = |resolved: Resolved| {
        let threads = BuilderThreads::new(resolved.setup.builder_threads)?;
        let animation = Arc::clone(animation);
        let Resolved {
            backend, options, ..
        } = resolved;
        Ok(Driver::new(backend, animation, options, threads)?)
    };
    start(animation, settings, workload, None, load)
}

fn start<T>(
    animation: &Arc<Animation>,
    settings: &TracerSettings,
    workload: Workload<'_>,
    opened: Option<SelectedBackend>,
    load: impl Fn(Resolved) -> Result<T, CliError>,
) -> Result<Started<T>, CliError> {
    check_trees(animation.triangle_count(), workload.rays)?;
    let prepare = |backend: Box<dyn Backend>| {
        let resolved = resolve(backend, animation, settings, workload)?;
        let setup = resolved.setup.clone();
        let tracer = load(resolved)?;
        Ok(Started { tracer, setup })
    };
    let first = opened.map(|opened| {
        let why = opened.why;
        prepare(opened.value).map(|value| Selected { value, why })
    });
    // If a backend that `auto` chose fails here, try the backends again with the scene.
    let is_auto = settings.backend.is_none();
    let first = first.filter(|first| first.is_ok() || !is_auto);
    let open = || (settings.device_to_open()).open_and(settings.backend, prepare);
    let selected = first.unwrap_or_else(open)?;
    let Started { tracer, mut setup } = selected.value;
    let choice = auto::choice("backend", setup.backend, selected.why);
    setup.auto.splice(0..0, choice);
    Ok(Started { tracer, setup })
}

/// A backend with enough memory for a scene, and the options of a driver on it.
struct Resolved {
    backend: Box<dyn Backend>,
    options: DriverOptions,
    setup: Setup,
}

/// Makes the choices of `auto` for a backend. Reopens a backend on the host if its number of threads does not suit the
/// chosen policy.
fn resolve(
    backend: Box<dyn Backend>,
    animation: &Animation,
    settings: &TracerSettings,
    workload: Workload<'_>,
) -> Result<Resolved, CliError> {
    let capabilities = Capabilities::of(backend.as_ref());
    let Selected {
        value: policy,
        why: why_policy,
    } = auto::choose_policy(capabilities, animation, settings, workload)?;
    let threads = settings.share(capabilities.device, policy);
    // Backends with 0 host threads are GPU backends, which ignore the number of threads.
    let backend = if [0, threads.render].contains(&backend.device().threads) {
        backend
    } else {
        let name = backend.device().backend.parse().ok();
        drop(backend);
        let reopened = DeviceSettings {
            threads: Some(threads.render),
            ..settings.device.clone()
        };
        reopened.open(name.or(settings.backend))?
    };
    let (kind, rays) = (capabilities.device, workload.rays);
    let options = DriverOptions {
        intersector: settings.intersector,
        update: policy,
        time_range: workload.time_range(),
        predict: settings.predict,
    };
    let memory = ExpectedMemory::of(animation, kind, &options, rays);
    check_device(backend.as_ref(), animation.triangle_count(), memory)?;
    let device = backend.device().clone();
    let choice = auto::choice("update", policy.name(), why_policy);
    let mut setup = Setup {
        backend: device.backend,
        adapter: device.adapter,
        driver: Some(device.driver).filter(|driver| !driver.is_empty()),
        threads: threads.render,
        builder_threads: threads.build,
        update: policy.name(),
        lockstep: policy.lockstep(),
        predict: policy.builds_concurrently().then_some(settings.predict),
        intersector: settings.intersector.name(),
        auto: choice.into_iter().collect(),
        memory: Some(memory),
        caption: String::new(),
    };
    setup.caption = setup.in_one_line(device.threads);
    Ok(Resolved {
        backend,
        options,
        setup,
    })
}

impl Setup {
    /// Formats the setup as one line. `threads` is the number of host threads that render, or 0.
    fn in_one_line(&self, threads: usize) -> String {
        let lockstep = self.lockstep.map(|k| format!(" lockstep {k}"));
        let lockstep = lockstep.unwrap_or_default();
        let predict = match self.predict {
            Some(false) => " without prediction",
            _ => "",
        };
        let work = |n: usize, [one, many]: [&str; 2]| match n {
            0 => String::new(),
            1 => format!("1 thread {one}"),
            n => format!("{n} threads {many}"),
        };
        let render = work(threads, ["renders, ", "render, "]);
        let build = work(self.builder_threads, ["builds", "build"]);
        let (backend, adapter, update) = (self.backend, &self.adapter, self.update);
        let device = format!("{backend} ({adapter}; {render}{build})");
        let intersector = self.intersector;
        format!("{device}, {update}{lockstep}{predict}, {intersector}")
    }
}

/// Refuses scenes whose trees and rays exceed the host's free memory. Key frames do not count: they are loaded already.
pub(crate) fn check_trees(triangles: usize, rays: usize) -> Result<(), CliError> {
    let checked = host::check_memory(trees_and_rays_bytes(triangles, rays));
    checked.map_err(|e| CliError::invalid(format!("trees over {triangles} triangles: {e}")))
}

/// Refuses scenes that exceed the device's free memory, if its driver reports it. On a software device, the scene must
/// also fit in the host's free memory.
fn check_device(
    backend: &dyn Backend,
    triangles: usize,
    memory: ExpectedMemory,
) -> Result<(), CliError> {
    let Some(need) = memory.device_bytes else {
        return Ok(());
    };
    let by = "memory of the device";
    let free = backend.memory().available;
    let free = free.map(|bytes| FreeMemory { bytes, by });
    let on_host = match backend.device().kind {
        DeviceKind::Software => host::free(),
        _ => None,
    };
    let checked = host::check_against(need, free).and_then(|()| host::check_against(need, on_host));
    checked.map_err(|e| {
        let name = &backend.device().adapter;
        CliError::invalid(format!("{triangles} triangles on {name}: {e}"))
    })
}
