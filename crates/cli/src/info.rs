//! `abvh info` describes this build and this machine. `abvh doctor` reports whether a GPU can be used.

use crate::auto;
use crate::command::RunCommand;
use crate::console;
use crate::devices::{BackendAvailability, DeviceSettings, availability};
use crate::error::CliError;
use crate::machine::{VERSION, cpu_model};
use crate::table::counted;
use clap::Args;
use comfy_table::{ContentArrangement, Table, presets};
use output::{AutoChoice, SCHEMA};
use serde::Serialize;

const WIDTH: usize = 100;

#[derive(Args, Debug)]
pub(crate) struct InfoSettings {
    /// Print JSON to standard output
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct MachineReport {
    schema: u32,
    version: &'static str,
    cpu: Option<String>,
    threads: usize,
    auto: Option<AutoChoice>,
    backends: Vec<BackendAvailability>,
}

impl RunCommand for InfoSettings {
    fn run(&self) -> Result<(), CliError> {
        let report = MachineReport {
            schema: SCHEMA,
            version: VERSION,
            cpu: cpu_model(),
            threads: host::cores(),
            auto: choice_of_auto()?,
            backends: availability().collect(),
        };
        if self.json {
            console::print_json(&report)
        } else {
            console::print(&text(&report))
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct DoctorSettings {}

impl RunCommand for DoctorSettings {
    /// Fails with exit code 1 if no GPU can be used.
    fn run(&self) -> Result<(), CliError> {
        let found = abvh::doctor();
        if !found.gpus.is_empty() {
            return console::print(&format!("usable GPUs: {}\n", found.gpus.join(", ")));
        }
        let each = found.problems.iter();
        let lines = each.map(|p| format!("missing: {}\n  fix: {}\n", p.what, p.fix));
        console::print(&lines.collect::<String>())?;
        let why = "no GPU can be used here; the host's cores can";
        Err(CliError::failed(why))
    }
}

/// Returns the backend that `auto` chooses. Opens backends to find it, because `auto` skips a GPU that fails its
/// self-test.
fn choice_of_auto() -> Result<Option<AutoChoice>, CliError> {
    let device = DeviceSettings {
        threads: Some(1),
        ..DeviceSettings::default()
    };
    let selected = device.open_and(None, |backend| Ok(backend.device().backend))?;
    Ok(auto::choice("backend", selected.value, selected.why))
}

fn text(report: &MachineReport) -> String {
    let row = |name: &str, value: &str| [name.to_owned(), value.to_owned()];
    let cpu = report.cpu.as_deref().unwrap_or("unknown");
    let threads = counted(report.threads, ["thread", "threads"]);
    let mut rows = vec![
        row("abvh", VERSION),
        row("cpu", &format!("{cpu}, {threads}")),
    ];
    if let Some(AutoChoice { takes, why, .. }) = &report.auto {
        rows.push(row("auto chooses", &format!("{takes}: {why}")));
    }
    for backend in &report.backends {
        rows.push(row("", ""));
        let state = match &backend.absent {
            None => "present".to_owned(),
            Some(why) => format!("absent: {why}"),
        };
        rows.push(row(backend.backend.name(), &state));
        for adapter in &backend.adapters {
            let name = format!("{} [{}]", adapter.name, adapter.kind.name());
            rows.push(row(&format!("  adapter {}", adapter.index), &name));
            if !adapter.driver.is_empty() {
                rows.push(row("    driver", &adapter.driver));
            }
            let limits = adapter.limits.iter();
            rows.extend(limits.map(|(name, value)| row(&format!("    {name}"), value)));
        }
    }
    let columns = console::columns().unwrap_or(WIDTH).min(WIDTH);
    table(&rows, columns as u16)
}

fn table(rows: &[[String; 2]], columns: u16) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(columns);
    table.add_rows(rows);
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    table.trim_fmt() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_long_values_within_columns() {
        let (name, why) = ("long name ".repeat(12), "because ".repeat(30));
        let rows = [("  adapter 0", name), ("auto chooses", why)];
        let rows = rows.map(|(name, value)| [name.to_owned(), value]);
        let text = table(&rows, 100);
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        let counts = ["because", "name"].map(|word| text.matches(word).count());
        assert_eq!(counts, [30, 12]);
    }
}
