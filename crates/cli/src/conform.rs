//! `abvh conform`: tests the selected properties on the selected backends of the user's machine.

use crate::command::RunCommand;
use crate::console::{self, ProgressLine};
use crate::error::CliError;
use crate::file_checks::CommandFiles;
use crate::table::{Cells, counted, table};
use crate::tested_backends::{TestSettings, TestedBackends};
use backend::Backend;
use clap::Args;
use clap::builder::PossibleValuesParser;
use conformance::{Cases, Disagreement, PROPERTIES, Property, Reference, check_property};
use serde::Serialize;
use std::collections::BTreeSet;
use std::time::Instant;

#[derive(Args, Debug)]
pub(crate) struct ConformSettings {
    #[command(flatten)]
    test: TestSettings,
    /// Seed of the generated scenes and rays
    #[arg(long, value_name = "S", default_value = "1")]
    seed: u64,
    /// Random cases per property; 0 tests no property
    #[arg(long, value_name = "N", default_value = "36", conflicts_with = "case")]
    cases: u32,
    /// Test only these properties, by name. An unknown name prints the valid ones
    #[arg(long, value_name = "LIST", value_delimiter = ',', hide_possible_values = true,
        value_parser = PossibleValuesParser::new(property_names()))]
    property: Vec<String>,
    /// Test only the case with this number
    #[arg(long, value_name = "N")]
    case: Option<u32>,
}

fn property_names() -> BTreeSet<&'static str> {
    PROPERTIES.iter().map(|property| property.name).collect()
}

impl RunCommand for ConformSettings {
    fn run(&self) -> Result<(), CliError> {
        CommandFiles::written(&[("--json", &self.test.json)]).check(&[])?;
        let mut tested = self.test.open()?;
        let report = ConformReport {
            rows: self.test_properties(&mut tested.backends)?,
            tested,
            seed: self.seed,
            cases: self.case.map_or(self.cases, |_| 1),
        };
        if let Some(file) = &self.test.json {
            output::write_json(file, &report)?;
        }
        console::print(&report.text())?;
        match report.failures() {
            0 => Ok(()),
            n => Err(CliError::failed(counted(
                n,
                ["disagreement", "disagreements"],
            ))),
        }
    }
}

impl ConformSettings {
    /// Tests the selected properties on every backend, against the reference backend.
    fn test_properties(
        &self,
        backends: &mut [Box<dyn Backend>],
    ) -> Result<Vec<PropertyRow>, CliError> {
        let named =
            |p: &&Property| self.property.is_empty() || self.property.iter().any(|n| n == p.name);
        let properties = || PROPERTIES.iter().filter(named);
        let total = backends.len() * properties().count();
        let numbers = match (self.case, self.cases) {
            (Some(case), _) => case..=case,
            (None, 0) => return Ok(Vec::new()),
            (None, cases) => 0..=cases - 1,
        };
        let cases = Cases::new(self.seed, numbers);
        let reference = abvh::backends::open_reference();
        let mut reference =
            Reference::new(reference.map_err(|e| CliError::invalid(e.to_string()))?);
        let mut progress = ProgressLine::new(total as u64, self.test.quiet);
        let mut rows = Vec::new();
        for backend in &mut *backends {
            let name = backend.device().backend;
            // Access to the output of single stages, which the properties compare.
            let subject = abvh::backends::inspect(backend.as_mut());
            let subject = subject.expect("the program opens only known backends");
            for property in properties() {
                let begun = Instant::now();
                let held = check_property(property, subject, &mut reference, &cases);
                let seconds = begun.elapsed().as_secs_f64();
                let row = PropertyRow {
                    property: property.name,
                    backend: name,
                    held: *held.as_ref().unwrap_or_else(|e| &e.held),
                    seconds,
                    reproduce: held.as_ref().err().map(|e| self.command(e)),
                    disagreement: held.err().map(|e| e.to_string()),
                };
                let result = match row.disagreement {
                    None => "held in",
                    Some(_) => "failed after",
                };
                let cases = counted(row.held as usize, ["case", "cases"]);
                let line = format!("{name} {}: {result} {cases}", property.name);
                progress.step(&format!("{line}, {seconds:.1} s"));
                if let Some(what) = &row.disagreement {
                    progress.say(what);
                }
                rows.push(row);
            }
        }
        Ok(rows)
    }

    /// Returns the command that reproduces a disagreement.
    fn command(&self, found: &Disagreement) -> String {
        let adapter = self.test.adapter_option();
        let (backend, options) = (found.backend, found.options());
        format!("abvh conform --backend {backend}{adapter} {options}")
    }
}

/// All results, for JSON and for text.
#[derive(Default, Serialize)]
struct ConformReport {
    #[serde(flatten)]
    tested: TestedBackends,
    seed: u64,
    /// Cases per property.
    cases: u32,
    rows: Vec<PropertyRow>,
}

#[derive(Serialize)]
struct PropertyRow {
    property: &'static str,
    backend: &'static str,
    /// Number of cases that passed before the first failure.
    held: u32,
    disagreement: Option<String>,
    reproduce: Option<String>,
    seconds: f64,
}

impl ConformReport {
    /// Returns the number of failed properties, over all backends.
    fn failures(&self) -> usize {
        let failed = self.rows.iter().filter(|r| r.disagreement.is_some());
        failed.count()
    }

    fn text(&self) -> String {
        let mut text = self.tested.text.clone();
        if !self.rows.is_empty() {
            text += &self.property_table();
        }
        for row in &self.rows {
            if let (Some(what), Some(command)) = (&row.disagreement, &row.reproduce) {
                text += &format!("{}: {what}\n    {command}\n", row.backend);
            }
        }
        text
    }

    /// Formats properties as rows and backends as columns.
    fn property_table(&self) -> String {
        let held = |property: &str, backend: &str| {
            let this = |r: &&PropertyRow| (r.property, r.backend) == (property, backend);
            match self.rows.iter().find(this) {
                None => "-".to_owned(),
                Some(r) if r.disagreement.is_some() => "DISAGREES".to_owned(),
                Some(r) => format!("held {}", r.held),
            }
        };
        let row = |property: &str| -> Cells<'_> {
            let held = self.tested.names.iter().map(|&on| (on, held(property, on)));
            let property = ("property", property.replace('_', " "));
            [property].into_iter().chain(held).collect()
        };
        // Each property once, in the order of the tests.
        let mut seen = BTreeSet::new();
        let properties = self
            .rows
            .iter()
            .map(|r| r.property)
            .filter(|&property| seen.insert(property));
        table(properties.map(row), 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(disagreement: Option<&str>) -> ConformReport {
        let row = |backend, property, disagreement: Option<&str>| PropertyRow {
            property,
            backend,
            held: 3,
            disagreement: disagreement.map(str::to_owned),
            reproduce: disagreement.map(|_| "abvh conform --case 3".to_owned()),
            seconds: 0.5,
        };
        let mut tested = TestedBackends::default();
        tested.names.extend(["x", "y"]);
        ConformReport {
            tested,
            // In the order of the tests.
            rows: vec![
                row("x", "a_b", None),
                row("x", "c_d", None),
                row("y", "a_b", disagreement),
            ],
            ..ConformReport::default()
        }
    }

    #[test]
    fn disagreement_is_counted_and_prints_reproducing_command() {
        let text = report(Some("property a_b: 1 is not 2")).text();
        let words: Vec<_> = text.split(' ').filter(|word| !word.is_empty()).collect();
        let table = words.join(" ");
        assert!(table.contains("a b held 3 DISAGREES") && table.contains("c d held 3 - "));
        let told = "y: property a_b: 1 is not 2\n    abvh conform --case 3\n";
        assert!(text.contains(told), "{text}");
        assert!(!report(None).text().contains("DISAGREES"));
        assert_eq!(report(None).failures(), 0);
        assert_eq!(report(Some("no")).failures(), 1);
    }
}
