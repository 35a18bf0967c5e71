//! A backend that serves one driver after another.

use super::Ask;
use crate::args::BackendName;
use crate::memory;
use crate::open;
use crate::stop::Stop;
use crate::threads::{self, Threads};
use backend::{Backend, Device, Method};
use clap::ValueEnum;
use geom::Animation;
use pipeline::{Driver, DriverOptions, Update};
use std::sync::Arc;

pub(crate) struct ReusedBackend<'a> {
    pub(super) animation: &'a Arc<Animation>,
    pub(super) device: Device,
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
            time_range: self.ask.ahead.time_range,
            predict: self.ask.ahead.predict,
        };
        let backend = self.take(threads.render)?;
        memory::check_device(&*backend, self.animation, (method, update), self.ask.rays())?;
        Ok(Driver::new(backend, Arc::clone(self.animation), options)?)
    }

    pub(super) fn put_back(&mut self, driver: Driver) {
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
