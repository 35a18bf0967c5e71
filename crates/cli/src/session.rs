//! A driver set up as asked, ready for its first frame.

use crate::args::{BackendName, IntersectorName, LayoutName, MethodArgs};
pub(crate) use crate::choose::Ask;
use crate::choose::{self, Settled};
use crate::memory;
use crate::open;
use crate::stop::Stop;
use crate::threads::{self, Threads};
use backend::{Backend, Device, DeviceKind, Method};
use clap::ValueEnum;
use geom::Animation;
use output::Taken;
use pipeline::{Driver, DriverOptions, ExpectedMemory, Update};
use std::sync::Arc;

/// A driver, and what it was made from.
pub(crate) struct Session {
    pub(crate) driver: Driver,
    pub(crate) device: Device,
    /// How rays are traced and how trees lie in memory, by name.
    pub(crate) method: [&'static str; 2],
    pub(crate) update: Update,
    /// With `async`: whether trees are built for what comes.
    pub(crate) predict: Option<bool>,
    pub(crate) threads: Threads,
    pub(crate) memory: ExpectedMemory,
    /// What was left to `auto`.
    pub(crate) taken: Vec<Taken>,
}

/// Opens the backend, settles what is left to `auto`, and loads the scene.
pub(crate) fn start(animation: &Arc<Animation>, ask: &Ask<'_>) -> Result<Session, Stop> {
    let rays = ask.rays();
    memory::check_trees(animation.triangle_count(), rays)?;
    let ask = &for_backend(ask)?;
    let (render, build) = (ask.threads, ask.builder_threads);
    let host = threads::share(
        threads::cores(),
        DeviceKind::Cpu,
        ask.update.value,
        render,
        build,
    );
    let on = (ask.adapter, host.render);
    let (opened, why) = open::open(ask.backend, on, |backend: Box<dyn Backend>| {
        let device = backend.device().clone();
        let mut backend = ReusedBackend::new(backend, animation, ask);
        let settled = choose::settle(&mut backend, ask)?;
        let driver = backend.driver(settled.method, settled.update)?;
        let threads = backend.share(settled.update);
        Ok((driver, device, settled, threads))
    })?;
    let (mut driver, device, settled, threads) = opened;
    let names = method_names(ask, settled.method);
    let (update, how) = (settled.update, (settled.method, settled.update));
    let taken = taken((&device, why), settled, names);
    Ok(Session {
        memory: ExpectedMemory::of(animation, device.kind, how, rays),
        device: driver.backend().device().clone(),
        driver,
        threads,
        method: names,
        update,
        predict: matches!(update, Update::Async(_)).then_some(ask.predict),
        taken,
    })
}

/// What is asked of a backend that makes its trees itself: nothing is left to choose there.
fn for_backend<'a>(ask: &Ask<'a>) -> Result<Ask<'a>, Stop> {
    if !open::has_own_trees(ask.backend) {
        return Ok(*ask);
    }
    if let Some(what) = choose::beyond_drivers(ask.method) {
        return Err(Stop::bad(format!(
            "a driver that makes its own trees has its own intersector and layout: it does not know {what}"
        )));
    }
    Ok(Ask {
        update: choose::within_frames(ask.update),
        run: None,
        rays: ask.rays(),
        method: MethodArgs {
            intersector: IntersectorName::Watertight,
            layout: LayoutName::Auto,
        },
        ..*ask
    })
}

fn method_names(ask: &Ask<'_>, method: Method) -> [&'static str; 2] {
    match open::has_own_trees(ask.backend) {
        true => [open::DRIVERS; 2],
        false => [method.intersector.name(), method.layout.name()],
    }
}

fn taken(
    (device, why): (&Device, Option<String>),
    settled: Settled,
    [intersector, layout]: [&'static str; 2],
) -> Vec<Taken> {
    let own = || Some("the driver has its own".to_owned());
    let why_all = match (intersector == open::DRIVERS, settled.why) {
        (true, [update, ..]) => [why, update, own(), own()],
        (false, [update, intersector, layout]) => [why, update, intersector, layout],
    };
    let update = settled.update.name();
    let all = [
        ("backend", device.backend),
        ("update", update),
        ("intersector", intersector),
        ("layout", layout),
    ];
    let all = all.into_iter().zip(why_all);
    all.filter_map(|((what, takes), why)| choose::taken(what, takes, why))
        .collect()
}

impl Session {
    /// Who works how, in one line.
    pub(crate) fn caption(&self) -> String {
        let lockstep =
            choose::lockstep(self.update).map_or(String::new(), |k| format!(" lockstep {k}"));
        let predict = match self.predict {
            Some(false) => " without prediction",
            _ => "",
        };
        let render = match self.device.threads {
            0 => String::new(),
            1 => "1 thread renders, ".to_owned(),
            n => format!("{n} threads render, "),
        };
        let build = match self.threads.build {
            1 => "1 thread builds".to_owned(),
            n => format!("{n} threads build"),
        };
        format!(
            "{} ({}; {render}{build}), {}{lockstep}{predict}, {}, {}",
            self.device.backend,
            self.device.adapter,
            self.update.name(),
            self.method[0],
            self.method[1],
        )
    }
}

/// A backend that serves one driver after another.
pub(crate) struct ReusedBackend<'a> {
    pub(crate) animation: &'a Arc<Animation>,
    pub(crate) device: Device,
    ask: &'a Ask<'a>,
    /// None while a driver has it, and after one broke down over it.
    backend: Option<Box<dyn Backend>>,
}

impl<'a> ReusedBackend<'a> {
    /// With a backend that was opened for `ask`.
    pub(crate) fn new(
        backend: Box<dyn Backend>,
        animation: &'a Arc<Animation>,
        ask: &'a Ask<'a>,
    ) -> Self {
        Self {
            animation,
            device: backend.device().clone(),
            ask,
            backend: Some(backend),
        }
    }

    /// How cores are shared under a policy.
    pub(crate) fn share(&self, update: Update) -> Threads {
        let (render, build) = (self.ask.threads, self.ask.builder_threads);
        threads::share(threads::cores(), self.device.kind, update, render, build)
    }

    /// A driver that traces by `method` and follows the motion by `update`, as a run of its own would have it.
    pub(crate) fn driver(&mut self, method: Method, update: Update) -> Result<Driver, Stop> {
        let threads = self.share(update);
        let options = DriverOptions {
            method,
            update,
            builder_threads: threads.build,
            time_range: self.ask.time_range(),
            predict: self.ask.predict,
        };
        let backend = self.take(threads.render)?;
        memory::check_device(&*backend, self.animation, (method, update), self.ask.rays())?;
        Ok(Driver::new(backend, Arc::clone(self.animation), options)?)
    }

    pub(crate) fn put_back(&mut self, driver: Driver) {
        self.backend = Some(driver.into_backend());
    }

    /// The backend at hand, or another of the same kind if that computes on other threads or is gone.
    fn take(&mut self, threads: usize) -> Result<Box<dyn Backend>, Stop> {
        if let Some(backend) = self.backend.take() {
            // 0 of those whose device computes.
            if [0, threads].contains(&backend.device().threads) {
                return Ok(backend);
            }
        }
        let named = BackendName::from_str(self.device.backend, true);
        let backend = named.unwrap_or(self.ask.backend);
        open::bare(backend, self.ask.adapter, threads)
    }
}
