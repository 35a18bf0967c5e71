//! `abvh stability`: how often each intersector is wrong in numerically hard cases, compared with baselines.

use crate::command::RunCommand;
use crate::console::{self, ProgressLine};
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::parsers;
use crate::table::{format_count, table};
use crate::tested_backends::{TestSettings, TestedBackends};
use backend::{Backend, Intersector};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use conformance::stability::{
    Family, Measure, MeasuredRate, Plan, StabilityCell, StabilityTest, baseline,
};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args, Debug)]
pub(crate) struct StabilitySettings {
    #[command(flatten)]
    test: TestSettings,
    /// Intersectors
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parsers::intersector())]
    #[arg(default_values = Intersector::ALL.map(Intersector::name))]
    intersector: Vec<Intersector>,
    /// Seed of the generated scenes and rays
    #[arg(long, value_name = "S", default_value_t = Plan::default().seed)]
    seed: u64,
    /// Rays of each family. A family is one kind of hard case, such as thin triangles, huge coordinates or rays at edges
    #[arg(long, value_name = "N", default_value_t = Plan::default().rays,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=1_000_000))]
    rays: u32,
    /// Instead of checking, measure the error rates of one backend and write them to this file. Checks use only the
    /// baselines in the program. To add the file to them, see docs/checking.md
    #[arg(long, value_name = "FILE", value_parser = parsers::file(), conflicts_with_all = ["json", "intersector", "seed", "rays"])]
    record: Option<PathBuf>,
    /// With --record: measure the seeds from 1 to N
    #[arg(long, value_name = "N", default_value = "32", requires = "record",
        value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
}

impl RunCommand for StabilitySettings {
    fn run(&self) -> Result<(), CliError> {
        let written = [("--json", &self.test.json), ("--record", &self.record)];
        CommandFiles::written(&written).check(&[])?;
        let mut tested = self.test.open()?;
        if let Some(file) = &self.record {
            return self.record_rates(&mut tested.backends, file);
        }
        let mut intersectors = Intersector::ALL.to_vec();
        intersectors.retain(|intersector| self.intersector.contains(intersector));
        let report = StabilityReport {
            rows: self.measure(&intersectors, &mut tested.backends)?,
            tested,
            adapter_option: self.test.adapter_option(),
            seed: self.seed,
            rays: self.rays,
        };
        if let Some(file) = &self.test.json {
            output::write_json(file, &report)?;
        }
        console::print(&report.text(&intersectors))?;
        match report.failures() {
            0 => Ok(()),
            1 => Err(CliError::failed("1 result is outside its bounds")),
            n => Err(CliError::failed(format!(
                "{n} results are outside their bounds"
            ))),
        }
    }
}

impl StabilitySettings {
    /// Measures error rates as a baseline. Fails unless exactly one backend is given.
    fn record_rates(&self, backends: &mut [Box<dyn Backend>], file: &Path) -> Result<(), CliError> {
        let [backend] = backends else {
            let names: Vec<_> = backends.iter().map(|b| b.device().backend).collect();
            let there = format!("there are {}; name one with --backend", names.join(", "));
            return Err(CliError::invalid(format!(
                "--record measures one backend, but {there}"
            )));
        };
        let mut progress = ProgressLine::new(Family::ALL.len() as u64, self.test.quiet);
        let name = backend.device().backend;
        let mut step = |family: Family| progress.step(&format!("{name} {family}"));
        let found = baseline::record(backend.as_mut(), self.seeds, self.rays, &mut step)?;
        output::write_json(file, &found)?;
        let rates = found.entries.len();
        console::print(&format!("{rates} rates of {}\n", found.measured_on))
    }

    /// Measures every family on the selected backends.
    fn measure(
        &self,
        intersectors: &[Intersector],
        backends: &mut [Box<dyn Backend>],
    ) -> Result<Vec<StabilityRow>, CliError> {
        let plan = Plan {
            seed: self.seed,
            rays: self.rays,
        };
        let steps = Family::ALL.len() * backends.len();
        let mut progress = ProgressLine::new(steps as u64, self.test.quiet);
        let mut rows = Vec::new();
        for family in Family::ALL {
            let test = StabilityTest::new(family, &plan);
            for backend in &mut *backends {
                let name = backend.device().backend;
                for &intersector in intersectors {
                    let begun = Instant::now();
                    let cell = test.run(backend.as_mut(), intersector)?;
                    rows.push(StabilityRow {
                        backend: name,
                        cell,
                        seconds: begun.elapsed().as_secs_f64(),
                    });
                }
                progress.step(&format!("{name} {family}"));
            }
        }
        Ok(rows)
    }
}

#[derive(Default, Serialize)]
struct StabilityReport {
    #[serde(flatten)]
    tested: TestedBackends,
    /// `--adapter` of the commands that reproduce failures, or empty.
    #[serde(skip)]
    adapter_option: String,
    seed: u64,
    /// Number of rays of each family.
    rays: u32,
    rows: Vec<StabilityRow>,
}

/// Result of one family with one intersector on one backend.
struct StabilityRow {
    backend: &'static str,
    cell: StabilityCell,
    seconds: f64,
}

impl Serialize for StabilityRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (cell, wrong) = (&self.cell, self.cell.wrong());
        let of = |measure| cell.get(measure).map(count);
        let row = json!({
            "family": cell.family.name(),
            "backend": self.backend,
            "intersector": cell.intersector.name(),
            "rays": wrong.of,
            "wrong": wrong.count,
            "rate": wrong.rate(),
            "bound": wrong.bound,
            // Only for closed meshes. Leaks are rays from inside that hit nothing. Double hits are rays that cross the
            // surface an odd number of times from outside, or an even number of times from inside. Double hits of
            // `exact` are not counted.
            "leaks": of(Measure::Leaks),
            "double_hits": of(Measure::DoubleHits),
            // Whether every count is within its bound.
            "ok": cell.is_ok(),
            "seconds": self.seconds,
        });
        row.serialize(serializer)
    }
}

fn count(m: &MeasuredRate) -> Value {
    json!({ "rays": m.of, "count": m.count, "rate": m.rate(), "bound": m.bound, "ok": m.is_ok() })
}

impl StabilityReport {
    /// Returns the number of cells with a count outside its bound.
    fn failures(&self) -> usize {
        self.rows.iter().filter(|r| !r.cell.is_ok()).count()
    }

    fn text(&self, intersectors: &[Intersector]) -> String {
        let mut text = self.tested.text.clone();
        for backend in &self.tested.names {
            text += &self.tables(backend, intersectors);
        }
        for row in self.rows.iter().filter(|r| !r.cell.is_ok()) {
            text += &self.failure_text(row);
        }
        text
    }

    /// Formats families as rows and intersectors as columns: first wrong answers, then leaks and double hits.
    fn tables(&self, backend: &str, intersectors: &[Intersector]) -> String {
        let mut text = format!("\n{backend}, rays of each family: {}\n", self.rays);
        text += &self.table(backend, "wrong", intersectors, &|r| share(r.cell.wrong()));
        text + &self.table(backend, "leaks, double hits", intersectors, &|r| {
            let all = [Measure::Leaks, Measure::DoubleHits].map(|m| r.cell.get(m).map(share));
            all.into_iter().flatten().collect::<Vec<_>>().join(", ")
        })
    }

    /// Formats the families for which `cell` returns text.
    fn table(
        &self,
        backend: &str,
        what: &str,
        intersectors: &[Intersector],
        cell: &dyn Fn(&StabilityRow) -> String,
    ) -> String {
        let row = |family: Family| {
            let of = |intersector: &Intersector| {
                let this = (backend, family, *intersector);
                let is_this =
                    |r: &&StabilityRow| (r.backend, r.cell.family, r.cell.intersector) == this;
                let found = self.rows.iter().find(is_this);
                (intersector.name(), found.map_or("-".to_owned(), cell))
            };
            let cells: Vec<_> = intersectors.iter().map(of).collect();
            let has_text = cells.iter().any(|(_, c)| !c.is_empty() && c != "-");
            has_text.then(|| [vec![(what, family.name().to_owned())], cells].concat())
        };
        let rows: Vec<_> = Family::ALL.into_iter().filter_map(row).collect();
        if rows.is_empty() {
            String::new()
        } else {
            table(rows, 1)
        }
    }

    /// Returns the counts outside their bounds, and the command that reproduces them.
    fn failure_text(&self, row: &StabilityRow) -> String {
        let (backend, intersector) = (row.backend, row.cell.intersector);
        let out = row.cell.measured.iter().filter(|m| !m.is_ok());
        let out = out.map(|m| {
            let expected = match m.bound {
                Some([_, 0.0]) => "none".to_owned(),
                Some([low, high]) => format!("{} to {}", percent(low), percent(high)),
                None => "an unknown rate; abvh stability --record measures it".to_owned(),
            };
            let [count, of] = [m.count, m.of].map(|n| format_count(n as usize));
            let (what, rate) = (m.measure.name().replace('_', " "), percent(m.rate()));
            format!("{what} {count} of {of} ({rate}), expected {expected}")
        });
        let out = out.collect::<Vec<_>>().join("; ");
        let (family, seed, rays) = (row.cell.family, self.seed, self.rays);
        let adapter = &self.adapter_option;
        format!(
            "{backend} {intersector} {family}: {out}\n    abvh stability --backend {backend}{adapter} --intersector {intersector} --seed {seed} --rays {rays}\n"
        )
    }
}

/// Formats a rate with its count, marked if it is outside its bound.
fn share(m: &MeasuredRate) -> String {
    let text = match m.count {
        0 => "0".to_owned(),
        n => format!("{} {}", percent(m.rate()), format_count(n as usize)),
    };
    match m.bound {
        _ if m.is_ok() => text,
        Some([low, _]) if m.rate() < low => format!("BETTER {text}"),
        Some(_) => format!("WORSE {text}"),
        None => format!("UNKNOWN {text}"),
    }
}

fn percent(rate: f64) -> String {
    format!("{:.3}%", 100.0 * rate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::Arithmetic;

    fn report(wrong: u64, leaks: u64, by: Intersector) -> StabilityReport {
        let counts = vec![
            MeasuredRate::new(Measure::Wrong, wrong, 2000),
            MeasuredRate::new(Measure::Leaks, leaks, 1000),
            MeasuredRate::new(Measure::DoubleHits, 0, 2000),
        ];
        let cell = StabilityCell::new(Family::Edges, by, counts, Arithmetic::IEEE);
        StabilityReport {
            adapter_option: " --adapter 'y'".to_owned(),
            seed: 9,
            rays: 2000,
            rows: vec![StabilityRow {
                backend: "x",
                cell,
                seconds: 0.5,
            }],
            ..StabilityReport::default()
        }
    }

    #[test]
    fn unexpected_errors_print_reproducing_command() {
        let sound = report(0, 0, Intersector::Exact);
        assert!(sound.failures() == 0 && sound.text(&Intersector::ALL).is_empty());
        let bad = report(1, 2, Intersector::Exact);
        assert_eq!(bad.failures(), 1);
        let text = bad.text(&Intersector::ALL) + &bad.tables("x", &Intersector::ALL);
        for part in [
            "x exact edges: wrong 1 of 2,000 (0.050%), expected none; leaks 2 of 1,000 (0.200%), expected none\n",
            "\n    abvh stability --backend x --adapter 'y' --intersector exact --seed 9 --rays 2000\n",
            "WORSE 0.050% 1",
            "WORSE 0.200% 2, 0",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn unexpectedly_low_error_rate_fails() {
        let bad = report(0, 0, Intersector::Woop);
        assert_eq!(bad.failures(), 1);
        assert!(bad.tables("x", &[Intersector::Woop]).contains("BETTER 0"));
    }
}
