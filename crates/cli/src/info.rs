//! `abvh info`: describes this build and this machine.

use crate::open::{self, Presence};
use crate::stop::Stop;
use crate::table::counted;
use crate::{choose, talk};
use backend::Backend;
use comfy_table::{ContentArrangement, Table, presets};
use output::{SCHEMA, Taken};
use serde::Serialize;

const VERSION: &str = env!("CARGO_PKG_VERSION");
const WIDTH: usize = 100;

#[derive(Serialize)]
struct Info {
    schema: u32,
    version: &'static str,
    cpu: Option<String>,
    threads: usize,
    auto: Option<Taken>,
    backends: Vec<Presence>,
}

pub(crate) fn run(json: bool) -> Result<(), Stop> {
    let info = Info {
        schema: SCHEMA,
        version: VERSION,
        cpu: cpu_model(),
        threads: host::cores(),
        auto: what_auto_takes()?,
        backends: open::presences().collect(),
    };
    match json {
        true => talk::print_json(&info),
        false => talk::print(&text(&info)),
    }
}

/// `abvh doctor`: fails with exit code 1 if no GPU can be used.
pub(crate) fn doctor() -> Result<(), Stop> {
    let found = abvh::doctor();
    if !found.gpus.is_empty() {
        return talk::print(&format!("can be used: {}\n", found.gpus.join(", ")));
    }
    let each = found.problems.iter();
    let lines = each.map(|p| format!("missing: {}\n  mend: {}\n", p.what, p.mend));
    talk::print(&lines.collect::<String>())?;
    Err(Stop::failed(
        "no GPU can be used here; the host's cores can",
    ))
}

/// Returns the backend that `auto` chooses. Opens it, since a GPU that fails its test at opening is not chosen.
fn what_auto_takes() -> Result<Option<Taken>, Stop> {
    let name = |backend: Box<dyn Backend>| Ok(backend.device().backend);
    let (name, why) = open::open(None, (None, 1), name)?;
    Ok(choose::taken("backend", name, why))
}

fn text(info: &Info) -> String {
    let row = |name: &str, value: &str| [name.to_owned(), value.to_owned()];
    let cpu = info.cpu.as_deref().unwrap_or("unknown");
    let threads = counted(info.threads, ["thread", "threads"]);
    let mut rows = vec![
        row("abvh", VERSION),
        row("cpu", &format!("{cpu}, {threads}")),
    ];
    if let Some(Taken { takes, why, .. }) = &info.auto {
        rows.push(row("auto takes", &format!("{takes}: {why}")));
    }
    for backend in &info.backends {
        rows.push(row("", ""));
        let state = match &backend.absent {
            None => "present".to_owned(),
            Some(why) => format!("absent: {why}"),
        };
        rows.push(row(backend.backend.name(), &state));
        rows.push(row("  intersectors", &backend.intersectors.join(", ")));
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
    let columns = talk::columns().unwrap_or(WIDTH).min(WIDTH);
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

/// Returns the processor's name, if the system reports it.
pub(crate) fn cpu_model() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}

pub(crate) fn command_line() -> Vec<String> {
    std::env::args_os()
        .map(|a| a.to_string_lossy().into_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_values_are_told_whole_within_the_columns() {
        let (name, why) = ("long name ".repeat(12), "because ".repeat(30));
        let rows = [("  adapter 0", name), ("auto takes", why)];
        let rows = rows.map(|(name, value)| [name.to_owned(), value]);
        let text = table(&rows, 100);
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        let counts = ["because", "name"].map(|word| text.matches(word).count());
        assert_eq!(counts, [30, 12]);
    }
}
