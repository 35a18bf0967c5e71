//! Options of a tracer.

use crate::{Device, Error, Intersector, Mesh, Result, Update};
use backend::{Backend, DeviceKind};
use pipeline::{BuilderThreads, DriverOptions, Threads};

/// Maximum number of threads per option. Many more would take minutes to start.
const MOST_THREADS: usize = 4096;

/// Configures and creates a [`Tracer`](crate::Tracer).
#[derive(Clone, Debug)]
pub struct TracerBuilder {
    pub(crate) device: Device,
    /// `None` leaves the choice to [`TracerBuilder::policy`].
    update: Option<Update>,
    intersector: Intersector,
    threads: Option<usize>,
    builder_threads: Option<usize>,
    time_range: [f64; 2],
    predict: bool,
}

impl TracerBuilder {
    /// Returns the default options.
    pub(crate) fn new() -> Self {
        Self {
            device: Device::Auto,
            update: None,
            intersector: Intersector::Watertight,
            threads: None,
            builder_threads: None,
            time_range: [0.0, f64::INFINITY],
            predict: true,
        }
    }

    /// Sets the device. The default is [`Device::Auto`].
    #[must_use]
    pub fn device(self, device: Device) -> Self {
        Self { device, ..self }
    }

    /// Sets how trees follow the motion. The default is [`Update::Refit`] if no mesh can move, else [`Update::Async`].
    #[must_use]
    pub fn update(self, update: Update) -> Self {
        let update = Some(update);
        Self { update, ..self }
    }

    /// Sets the ray-triangle test. The default is [`Intersector::Watertight`].
    #[must_use]
    pub fn intersector(self, intersector: Intersector) -> Self {
        Self {
            intersector,
            ..self
        }
    }

    /// Sets the number of host threads, `n`. If the host traces, `n` threads trace. With [`Update::Async`] and
    /// [`Update::Lockstep`], `n / 4` more threads build trees at the same time. If a GPU traces, `n` threads build
    /// trees, or `n - 1` with these policies. At least one thread builds.
    ///
    /// By default, a host that traces uses one thread per core. With [`Update::Async`] or [`Update::Lockstep`] and at
    /// least four cores, a quarter of these threads builds and the others trace. For a GPU, one thread per two cores
    /// builds trees, which leaves cores for the program.
    #[must_use]
    pub fn threads(self, threads: usize) -> Self {
        let threads = Some(threads.max(1));
        Self { threads, ..self }
    }

    /// Sets the number of host threads that build trees. The default is described at [`TracerBuilder::threads`].
    #[must_use]
    pub fn builder_threads(mut self, threads: usize) -> Self {
        self.builder_threads = Some(threads.max(1));
        self
    }

    /// Sets the first and the last time of all future steps, in key frames. No tree is built for a time outside this
    /// range. The default is all times from 0 on.
    #[must_use]
    pub fn time_range(self, time_range: [f64; 2]) -> Self {
        Self { time_range, ..self }
    }

    /// Sets whether trees are built for predicted positions, which is the default. Otherwise they are built for the
    /// positions of the step that requests them. This is mainly useful to measure the gain of prediction.
    #[must_use]
    pub fn predict(self, predict: bool) -> Self {
        Self { predict, ..self }
    }

    /// Returns the policy for a scene of `meshes`.
    pub(crate) fn policy(&self, meshes: &[Mesh]) -> Update {
        self.update.unwrap_or_else(|| {
            let is_fixed = meshes.iter().all(|m| m.motion.is_fixed());
            if is_fixed {
                Update::Refit
            } else {
                Update::Async
            }
        })
    }

    pub(crate) fn options(&self, update: Update) -> DriverOptions {
        DriverOptions {
            intersector: self.intersector,
            update,
            time_range: self.time_range,
            predict: self.predict,
        }
    }

    /// Returns the number of rendering threads for a backend that computes on the host.
    pub(crate) fn host_threads(&self, update: Update) -> Result<usize> {
        Ok(self.thread_counts(DeviceKind::Cpu, update)?.render)
    }

    /// Starts the threads that build trees for a device of this kind.
    pub(crate) fn start_builder_threads(
        &self,
        kind: DeviceKind,
        update: Update,
    ) -> Result<BuilderThreads> {
        let requested = self.threads.or(self.builder_threads);
        let threads = match (requested, self.thread_counts(kind, update)?.build) {
            // With more builder threads, steps lose more time waiting for cores than they gain by newer trees.
            (None, all) if kind == DeviceKind::Gpu => all.div_ceil(2),
            (_, shared) => shared,
        };
        BuilderThreads::new(threads).map_err(Error::of_driver)
    }

    fn thread_counts(&self, kind: DeviceKind, update: Update) -> Result<Threads> {
        let requested = [self.threads, self.builder_threads];
        match requested.into_iter().flatten().max() {
            Some(most) if most > MOST_THREADS => {
                let why = format!("{most} threads are too many: the maximum is {MOST_THREADS}");
                Err(Error::Unsupported(why))
            }
            _ => Ok(Threads::share(host::cores(), kind, update, requested)),
        }
    }
}

/// Returns the name of a backend and its adapter.
pub(crate) fn device_name(backend: &dyn Backend) -> String {
    let device = backend.device();
    format!("{} ({})", device.backend, device.adapter)
}
