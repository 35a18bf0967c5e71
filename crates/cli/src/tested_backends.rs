//! The backends that `conform`, `stability` and `stress` test, and their description in reports.

use crate::devices::{BackendChoice, DeviceSettings};
use crate::error::CliError;
use crate::machine::{self, VERSION};
use crate::parsers;
use backend::{Backend, BackendName};
use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;

/// The backends to test, and where results go.
#[derive(Args, Debug)]
pub(crate) struct TestSettings {
    /// Backends. auto selects all available ones except the reference, or with stress the best one
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = parsers::AUTO, value_parser = parsers::backend("All available backends except the reference; with stress, the best one"))]
    pub(crate) backend: Vec<BackendChoice>,
    /// Adapter of the backends, by index or by part of its name
    #[arg(long, value_name = "INDEX|NAME-PART")]
    pub(crate) adapter: Option<String>,
    /// JSON file for the results
    #[arg(long, value_name = "FILE", value_parser = parsers::file())]
    pub(crate) json: Option<PathBuf>,
    /// Print no progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// The machine and the backends of a test report.
#[derive(Default, Serialize)]
pub(crate) struct TestedBackends {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    machine: Value,
    backends: Vec<Value>,
    absent: Vec<AbsentBackend>,
    /// Names of the backends under test.
    #[serde(skip)]
    pub(crate) names: Vec<&'static str>,
    /// One line for each backend, available or not.
    #[serde(skip)]
    pub(crate) text: String,
}

impl TestedBackends {
    fn new(opened: &[Box<dyn Backend>], absent: Vec<AbsentBackend>) -> Self {
        let mut tested = Self {
            schema: output::SCHEMA,
            version: VERSION,
            command_line: machine::command_line(),
            machine: json!({
                "cpu": machine::cpu_model(),
                "cores": host::cores(),
                "os": std::env::consts::OS,
            }),
            ..Self::default()
        };
        for device in opened.iter().map(|backend| backend.device()) {
            let name = device.backend;
            let (adapter, own) = (&device.adapter, device.arithmetic.to_string());
            let driver = match device.driver.trim() {
                "" => String::new(),
                driver => format!(" ({driver})"),
            };
            tested.text += &format!("{name}: {adapter}{driver}; arithmetic: {own}\n");
            tested.names.push(name);
            tested.backends.push(json!({
                "backend": name,
                "adapter": adapter,
                "driver": device.driver,
                "kind": device.kind.name(),
                "threads": device.threads,
                "arithmetic": own,
            }));
        }
        for AbsentBackend { backend, reason } in &absent {
            tested.text += &format!("{backend}: absent; {reason}\n");
        }
        Self { absent, ..tested }
    }
}

/// A backend that cannot run.
#[derive(Serialize)]
struct AbsentBackend {
    backend: &'static str,
    reason: String,
}

/// Backends that are open, and their description.
pub(crate) struct OpenedBackends {
    pub(crate) backends: Vec<Box<dyn Backend>>,
    pub(crate) tested: TestedBackends,
}

impl TestSettings {
    /// Returns `--adapter` for a command that reproduces a result, after a space, or nothing if it is not set.
    pub(crate) fn adapter_option(&self) -> String {
        let adapter = self.adapter.as_deref();
        adapter.map_or(String::new(), |a| format!(" --adapter '{a}'"))
    }

    /// Opens the named backends. `auto` stands for all available backends except the reference.
    pub(crate) fn open(&self) -> Result<OpenedBackends, CliError> {
        let (mut backends, mut absent) = (Vec::new(), Vec::new());
        let takes_all = self.backend.contains(&None);
        for one in BackendName::ALL {
            let is_named = self.backend.contains(&Some(one));
            if !is_named && (!takes_all || one.is_reference()) {
                continue;
            }
            let device = DeviceSettings {
                adapter: self.adapter.clone(),
                ..DeviceSettings::of(Some(one))
            };
            match device.open() {
                Ok(backend) => backends.push(backend),
                Err(error) if is_named => return Err(error),
                Err(error) => absent.push(AbsentBackend {
                    backend: one.name(),
                    reason: error.to_string(),
                }),
            }
        }
        if backends.is_empty() {
            let reasons: Vec<_> = absent.into_iter().map(|absent| absent.reason).collect();
            return Err(CliError::invalid(reasons.join("; ")));
        }
        let tested = TestedBackends::new(&backends, absent);
        Ok(OpenedBackends { backends, tested })
    }
}
