//! A driver set up as asked, ready for its first frame.

use crate::args::{BackendName, MethodArgs};
use crate::choose::{self, Choice};
use crate::open;
use crate::stop::Stop;
use crate::threads::{self, Threads};
use backend::{Device, Method};
use geom::Animation;
use pipeline::{Driver, Options, Update};
use std::sync::Arc;

/// What to set up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask<'a> {
    /// Backend.
    pub(crate) backend: BackendName,
    /// Adapter of the backend.
    pub(crate) adapter: Option<&'a str>,
    /// Threads that render.
    pub(crate) threads: Option<usize>,
    /// Threads that build.
    pub(crate) builder_threads: Option<usize>,
    /// How rays are traced.
    pub(crate) method: MethodArgs,
    /// How trees follow the motion.
    pub(crate) update: Choice<Update>,
}

/// A driver, and what it was made from.
pub(crate) struct Session {
    /// The driver.
    pub(crate) driver: Driver,
    /// Who is at work.
    pub(crate) device: Device,
    /// How rays are traced.
    pub(crate) method: Method,
    /// How trees follow the motion.
    pub(crate) update: Update,
    /// How cores are shared.
    pub(crate) threads: Threads,
    /// What `auto` took and why, one remark each.
    pub(crate) remarks: Vec<String>,
}

/// Opens the backend and loads the scene into it.
pub(crate) fn start(animation: &Arc<Animation>, ask: &Ask<'_>) -> Result<Session, Stop> {
    let update = ask.update.value;
    let threads = threads::share(threads::cores(), update, ask.threads, ask.builder_threads);
    let opened = open::open(ask.backend, ask.adapter, threads.render)?;
    let device = opened.backend.device().clone();
    let method = choose::method(ask.method);
    let options = Options {
        method,
        update,
        builder_threads: threads.build,
    };
    let driver = Driver::new(opened.backend, Arc::clone(animation), options)?;
    let remark = |what: &str, name: &str, why: Option<&str>| {
        why.map(|why| format!("{what} auto takes {name}: {why}"))
    };
    let intersector = choose::intersector(ask.method.intersector);
    let layout = choose::layout(ask.method.layout);
    let remarks = [
        remark("backend", device.backend, opened.why.as_deref()),
        remark("update", choose::update_name(update), ask.update.why),
        remark("intersector", intersector.value.name(), intersector.why),
        remark("layout", layout.value.name(), layout.why),
    ];
    Ok(Session {
        driver,
        device,
        method,
        update,
        threads,
        remarks: remarks.into_iter().flatten().collect(),
    })
}

impl Session {
    /// Who works how, in one line.
    pub(crate) fn caption(&self) -> String {
        let lockstep =
            choose::lockstep(self.update).map_or(String::new(), |k| format!(" lockstep {k}"));
        format!(
            "{} ({}; {} threads render, {} build), {}{lockstep}, {}, {}",
            self.device.backend,
            self.device.adapter,
            self.threads.render,
            self.threads.build,
            choose::update_name(self.update),
            self.method.intersector,
            self.method.layout,
        )
    }
}
