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

/// The backends under test, and their description in a report.
#[derive(Default, Serialize)]
pub(crate) struct TestedBackends {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    machine: Value,
    #[serde(rename = "backends")]
    devices: Vec<Value>,
    /// Backends that cannot run, with the reasons.
    absent: Vec<Value>,
    #[serde(skip)]
    pub(crate) backends: Vec<Box<dyn Backend>>,
    /// Names of the backends under test.
    #[serde(skip)]
    pub(crate) names: Vec<&'static str>,
    /// One line for each selected backend, available or not.
    #[serde(skip)]
    pub(crate) text: String,
}

impl TestedBackends {
    fn add(&mut self, backend: Box<dyn Backend>) {
        let device = backend.device();
        let name = device.backend;
        let (adapter, own) = (&device.adapter, device.arithmetic.to_string());
        let driver = match device.driver.trim() {
            "" => String::new(),
            driver => format!(" ({driver})"),
        };
        self.text += &format!("{name}: {adapter}{driver}; arithmetic: {own}\n");
        self.names.push(name);
        self.devices.push(json!({
            "backend": name,
            "adapter": adapter,
            "driver": device.driver,
            "kind": device.kind.name(),
            "threads": device.threads,
            "arithmetic": own,
        }));
        self.backends.push(backend);
    }
}

impl TestSettings {
    /// Returns `--adapter` for a command that reproduces a result, after a space, or nothing if it is not set.
    pub(crate) fn adapter_option(&self) -> String {
        let adapter = self.adapter.as_deref();
        adapter.map_or(String::new(), |a| format!(" --adapter '{a}'"))
    }

    /// Opens the named backends. `auto` stands for all available backends except the reference.
    pub(crate) fn open(&self) -> Result<TestedBackends, CliError> {
        let mut tested = TestedBackends {
            schema: output::SCHEMA,
            version: VERSION,
            command_line: machine::command_line(),
            machine: json!({
                "cpu": machine::cpu_model(),
                "cores": host::cores(),
                "os": std::env::consts::OS,
            }),
            ..TestedBackends::default()
        };
        let device = DeviceSettings {
            adapter: self.adapter.clone(),
            ..DeviceSettings::default()
        };
        let mut reasons = Vec::new();
        let takes_all = self.backend.contains(&None);
        for one in BackendName::ALL {
            let is_named = self.backend.contains(&Some(one));
            if !is_named && (!takes_all || one.is_reference()) {
                continue;
            }
            match device.open(Some(one)) {
                Ok(backend) => tested.add(backend),
                Err(error) if is_named => return Err(error),
                Err(error) => {
                    let (backend, reason) = (one.name(), error.to_string());
                    tested.text += &format!("{backend}: absent; {reason}\n");
                    let absent = json!({ "backend": backend, "reason": reason });
                    tested.absent.push(absent);
                    reasons.push(reason);
                }
            }
        }
        if tested.backends.is_empty() {
            return Err(CliError::invalid(reasons.join("; ")));
        }
        Ok(tested)
    }
}
