//! Devices: their options, and how they are listed and opened.

use crate::error::{CliError, FAILED};
use crate::parsers::{self, AUTO};
use abvh::backends::{BACKENDS, find_backend, open_best};
use backend::{AdapterInfo, Backend, BackendName};
use clap::Args;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::thread::JoinHandle;

/// A backend; `None` leaves the choice to `auto`.
pub(crate) type BackendChoice = Option<BackendName>;

/// Returns the name of a backend on the command line.
pub(crate) fn backend_name(backend: BackendChoice) -> &'static str {
    backend.map_or(AUTO, BackendName::name)
}

/// The adapter, the threads and the kernel cache of a run, for any backend.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct DeviceSettings {
    /// Adapter, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// Threads that render
    #[arg(long, value_name = "N", value_parser = parsers::threads())]
    pub(crate) threads: Option<usize>,
    /// Threads that build trees. Default: the number of --threads, or else of cores. With async: one less than that if
    /// a GPU traces, a quarter if the host traces
    #[arg(long, value_name = "N", value_parser = parsers::threads())]
    pub(crate) builder_threads: Option<usize>,
    /// Neither read nor write compiled kernels in the user's cache folder
    #[arg(long)]
    pub(crate) no_cache: bool,
}

/// A value and, if `auto` chose it, the reason. For the result of [`DeviceSettings::open_and`], `why` is the reason for
/// the backend.
pub(crate) struct Selected<T> {
    pub(crate) value: T,
    pub(crate) why: Option<String>,
}

impl DeviceSettings {
    /// Opens a backend and passes it to `prepare`, which loads what the caller needs. A named backend is never
    /// replaced by another. `auto` skips backends that cannot be opened or for which `prepare` fails. A backend on the
    /// host gets the rendering threads, or one thread per core.
    pub(crate) fn open_and<T>(
        &self,
        backend: BackendChoice,
        prepare: impl Fn(Box<dyn Backend>) -> Result<T, CliError>,
    ) -> Result<Selected<T>, CliError> {
        if self.no_cache {
            abvh::backends::disable_kernel_cache();
        }
        let adapter = self.adapter.as_deref();
        let threads = self.threads.unwrap_or_else(host::cores);
        if let Some(name) = backend {
            let absent =
                || CliError::invalid(format!("this program was built without backend {name}"));
            let entry = find_backend(name).ok_or_else(absent)?;
            let opened = entry.open(adapter, threads).map_err(CliError::invalid)?;
            let value = prepare(opened)?;
            return Ok(Selected { value, why: None });
        }
        match open_best(adapter, threads, prepare) {
            Ok((value, why)) => Ok(Selected {
                value,
                why: Some(why),
            }),
            Err(none) => Err(match none.last_error {
                Some(e) if e.code == FAILED => CliError::failed(none.reason),
                _ => CliError::invalid(none.reason),
            }),
        }
    }

    /// Opens a backend without further preparation.
    pub(crate) fn open(&self, backend: BackendChoice) -> Result<Box<dyn Backend>, CliError> {
        Ok(self.open_and(backend, Ok)?.value)
    }
}

pub(crate) type SelectedBackend = Selected<Box<dyn Backend>>;

/// A backend that is being opened on another thread, because opening takes long. Dropping it joins the thread, because
/// drivers may fail if the process ends while they work. With NVIDIA's driver, the join takes 9 ms. The default
/// value opens no backend.
#[derive(Default)]
pub(crate) struct Opening(Option<JoinHandle<Result<SelectedBackend, CliError>>>);

impl Opening {
    /// Starts to open a backend. If no thread can be started, returns the default value.
    pub(crate) fn begin(backend: BackendChoice, device: DeviceSettings) -> Self {
        let open = move || device.open_and(backend, Ok);
        Self(std::thread::Builder::new().spawn(open).ok())
    }

    /// Waits for the result. Returns `None` if no backend is being opened.
    pub(crate) fn wait(mut self) -> Option<Result<SelectedBackend, CliError>> {
        let opened = self.0.take()?.join();
        // A panic of the thread continues here.
        Some(opened.unwrap_or_else(|e| std::panic::resume_unwind(e)))
    }
}

impl Drop for Opening {
    fn drop(&mut self) {
        let _ = self.0.take().map(JoinHandle::join);
    }
}

/// Availability of a backend on this machine.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BackendAvailability {
    #[serde(serialize_with = "serialize_name")]
    pub(crate) backend: BackendName,
    /// Reason why the backend is unavailable; `None` if it can run.
    pub(crate) absent: Option<String>,
    #[serde(serialize_with = "serialize")]
    pub(crate) adapters: Vec<AdapterInfo>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn serialize_name<S: Serializer>(backend: &BackendName, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(backend.name())
}

/// Serializes adapters to JSON.
fn serialize<S: Serializer>(all: &[AdapterInfo], to: S) -> Result<S::Ok, S::Error> {
    let limit = |(name, value): &(_, _)| json!({ "name": name, "value": value });
    to.collect_seq(all.iter().map(|adapter| {
        json!({
            "index": adapter.index,
            "name": adapter.name,
            "driver": adapter.driver,
            "kind": adapter.kind.name(),
            "limits": adapter.limits.iter().map(limit).collect::<Vec<_>>(),
        })
    }))
}

/// Returns all backends, available or not, in the order of [`BACKENDS`]. `auto` compares the kinds of devices first.
/// Among devices of one kind, it uses this order.
pub(crate) fn availability() -> impl DoubleEndedIterator<Item = BackendAvailability> {
    BACKENDS.iter().map(|entry| {
        let found = entry.adapters();
        BackendAvailability {
            backend: entry.name,
            absent: found.as_ref().err().map(ToString::to_string),
            adapters: found.unwrap_or_default(),
        }
    })
}

/// Returns whether a backend may be able to build trees on its device. Only the open backend knows for certain.
pub(crate) fn builds_trees(backend: BackendChoice) -> bool {
    !backend.is_some_and(BackendName::is_on_host)
}
