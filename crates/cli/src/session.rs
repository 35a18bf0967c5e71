//! Sets up a tracer as requested, ready for its first frame. Commands that measure get the library's driver instead.

use crate::args::BackendChoice;
use crate::choose;
pub(crate) use crate::choose::Ask;
use crate::open::{self, Opening};
use crate::stop::Stop;
use abvh::{Builder, Mesh, Tracer};
use backend::{Backend, BackendName, DeviceKind, Hits, Policy, Query, QueryKind, Rays};
use geom::{Animation, Ray};
use host::Free;
use output::Taken;
use pipeline::{
    Answers, BuilderThreads, Driver, DriverOptions, ExpectedMemory, Frame, Wanted, trees_bytes,
};
use scene::Scene;
use serde::Serialize;
use std::sync::Arc;

/// Device, threads and methods of a run.
#[derive(Clone, Serialize)]
pub(crate) struct Setup {
    pub(crate) backend: &'static str,
    pub(crate) adapter: String,
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
    pub(crate) auto: Vec<Taken>,
    #[serde(skip)]
    pub(crate) memory: Option<ExpectedMemory>,
    /// All of this in one line.
    #[serde(skip)]
    pub(crate) caption: String,
}

/// Starts to open the requested backend while the scene is read, if opening takes long.
pub(crate) fn begin(ask: &Ask<'_>) -> Opening {
    if ask.backend.is_some_and(BackendName::is_on_host) {
        Opening::default()
    } else {
        Opening::begin(ask.backend, on(ask))
    }
}

/// Returns the adapter, and the number of host threads that trace if the host is the device.
fn on<'a>(ask: &Ask<'a>) -> (Option<&'a str>, usize) {
    let host = ask.share(DeviceKind::Cpu, ask.update().0);
    (ask.adapter, host.render)
}

/// Makes the choices of `auto`, and loads the scene on the backend that is being opened.
pub(crate) fn start(
    scene: &Scene,
    ask: &Ask<'_>,
    opening: &mut Opening,
) -> Result<(Tracer, Setup), Stop> {
    let load = |(backend, options, threads): Taking| {
        let mut scene_of_one = abvh::Scene::new();
        scene_of_one.add(Mesh::from(scene));
        let builder = builder(options).builder_threads(threads);
        Ok(builder.build_on(backend, scene_of_one)?)
    };
    start_by(&scene.animation, ask, opening, load)
}

/// Makes the choices of `auto`, and loads the scene for a driver, which measures each stage.
pub(crate) fn start_driver(
    animation: &Arc<Animation>,
    ask: &Ask<'_>,
) -> Result<(Driver, Setup), Stop> {
    start_driver_on(Opening::default(), animation, ask)
}

/// Loads the scene for a driver of the backend that is being opened.
pub(crate) fn start_driver_on(
    mut opening: Opening,
    animation: &Arc<Animation>,
    ask: &Ask<'_>,
) -> Result<(Driver, Setup), Stop> {
    let load = |taking| driver(animation, taking);
    start_by(animation, ask, &mut opening, load)
}

/// Returns the library's builder for the options of a driver.
fn builder(options: DriverOptions) -> Builder {
    Tracer::builder()
        .update(options.update)
        .intersector(options.intersector)
        .time_range(options.time_range)
        .predict(options.predict)
}

fn start_by<T>(
    animation: &Arc<Animation>,
    ask: &Ask<'_>,
    opening: &mut Opening,
    load: impl Fn(Taking) -> Result<T, Stop>,
) -> Result<(T, Setup), Stop> {
    let rays = ask.rays();
    check_trees(animation.triangle_count(), rays)?;
    let ready = |backend: Box<dyn Backend>| {
        let (update, why) = choose::settle(backend.as_ref(), animation, ask)?;
        let taking = take(backend, animation, ask, update)?;
        let device = taking.0.device().clone();
        Ok((load(taking)?, device, update, why))
    };
    let opened = opening.wait().transpose()?;
    let first = opened.map(|(backend, why)| Ok((ready(backend)?, why)));
    // If `auto` chose the backend, another one may become ready.
    let first = first.filter(|first| first.is_ok() || ask.backend.is_some());
    let again = || open::open(ask.backend, on(ask), ready);
    let (opened, why) = first.unwrap_or_else(again)?;
    let (traces, device, update, why_update) = opened;
    let threads = ask.share(device.kind, update);
    let taken = [
        choose::taken("backend", device.backend, why),
        choose::taken("update", update.name(), why_update),
    ];
    let mut setup = Setup {
        backend: device.backend,
        adapter: device.adapter,
        driver: Some(device.driver).filter(|driver| !driver.is_empty()),
        threads: threads.render,
        builder_threads: threads.build,
        update: update.name(),
        lockstep: update.lockstep(),
        predict: update.builds_beside_frames().then_some(ask.predict),
        intersector: ask.intersector.name(),
        auto: taken.into_iter().flatten().collect(),
        memory: Some(ExpectedMemory::of(
            animation,
            device.kind,
            (ask.intersector, update),
            rays,
        )),
        caption: String::new(),
    };
    setup.caption = setup.in_one_line(device.threads);
    Ok((traces, setup))
}

impl Setup {
    /// Formats the setup. `threads` host threads render.
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
        let who = format!("{backend} ({adapter}; {render}{build})");
        let intersector = self.intersector;
        format!("{who}, {update}{lockstep}{predict}, {intersector}")
    }
}

/// Traces lists of rays in order, each at its time, and returns their hits.
pub(crate) fn trace_lists<'a>(
    driver: &mut Driver,
    kind: QueryKind,
    lists: impl IntoIterator<Item = (f64, &'a [Ray])>,
) -> Result<Vec<Hits>, Stop> {
    let trace = |(index, (time, rays))| {
        let rays = Rays::List(rays);
        let mut found = Answers::default();
        driver.begin(Frame { index, time }, &[Query { rays, kind }])?;
        driver.finish(Wanted::HITS, &mut found)?;
        Ok(found.hits)
    };
    (0..).zip(lists).map(trace).collect()
}

/// A backend with enough memory for the scene, the options of a driver, and the number of builder threads.
type Taking = (Box<dyn Backend>, DriverOptions, usize);

fn driver(animation: &Arc<Animation>, (backend, options, threads): Taking) -> Result<Driver, Stop> {
    let threads = BuilderThreads::new(threads)?;
    let animation = Arc::clone(animation);
    Ok(Driver::new(backend, animation, options, threads)?)
}

/// Prepares what a driver needs to follow the motion by a policy. A backend on the host that has another number of threads
/// is opened again.
fn take(
    backend: Box<dyn Backend>,
    animation: &Animation,
    ask: &Ask<'_>,
    update: Policy,
) -> Result<Taking, Stop> {
    let device = backend.device().clone();
    let threads = ask.share(device.kind, update);
    // 0 threads means that the device computes.
    let backend = if [0, threads.render].contains(&device.threads) {
        backend
    } else {
        drop(backend);
        let named: BackendChoice = device.backend.parse().ok().or(ask.backend);
        open::bare(named, ask.adapter, threads.render)?
    };
    check_device(&*backend, animation, ask, update)?;
    let options = DriverOptions {
        intersector: ask.intersector,
        update,
        time_range: ask.time_range(),
        predict: ask.predict,
    };
    Ok((backend, options, threads.build))
}

/// Refuses scenes whose trees and rays exceed the host's free memory. Key frames are already loaded.
pub(crate) fn check_trees(triangles: usize, rays: usize) -> Result<(), Stop> {
    let checked = host::check(trees_bytes(triangles, rays));
    checked.map_err(|e| Stop::bad(format!("trees over {triangles} triangles: {e}")))
}

/// Refuses scenes that exceed the device's free memory, if its driver reports that. For a software device, refuses also
/// scenes that exceed the host's free memory.
fn check_device(
    backend: &dyn Backend,
    animation: &Animation,
    ask: &Ask<'_>,
    update: Policy,
) -> Result<(), Stop> {
    let kind = backend.device().kind;
    let how = (ask.intersector, update);
    let Some(need) = ExpectedMemory::of(animation, kind, how, ask.rays()).device_bytes else {
        return Ok(());
    };
    let by = "memory of the device";
    let free = backend.free_device_bytes().map(|bytes| Free { bytes, by });
    let on_host = match kind {
        DeviceKind::Software => host::free(),
        _ => None,
    };
    let checked = host::within(need, free).and_then(|()| host::within(need, on_host));
    checked.map_err(|e| {
        let (name, triangles) = (&backend.device().adapter, animation.triangle_count());
        Stop::bad(format!("{triangles} triangles on {name}: {e}"))
    })
}
