//! `abvh conform`: tests every property on every backend of the user's machine.

mod oracle;

use crate::args::ConformArgs;
use crate::conflicts::Files;
use crate::open::{self, Subject, Tested};
use crate::stop::Stop;
use crate::table::{Cells, counted, grouped, table};
use crate::talk::{self, Progress};
use backend::{BackendName, Intersector};
use conformance::leaks::{self, LeakPlan, OFFSETS};
use conformance::{Cases, PROPERTIES, Property, Reference, hold};
use oracle::OracleRow;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::Instant;

/// Number of progress steps for all aimed rays.
const STEPS: u64 = 20;

pub(crate) fn run(args: &ConformArgs) -> Result<(), Stop> {
    Files::written(&[("--json", &args.test.json)]).check(&args.scene)?;
    let given = oracle::open(args)?;
    let (mut subjects, tested) = open::open_all(&args.test)?;
    let mut report = Report {
        tested,
        seed: args.seed,
        cases: args.cases,
        leak_rays: args.leak_rays,
        rows: properties(args, &mut subjects)?,
        oracle_rays: args.oracle_rays,
        ..Report::default()
    };
    for subject in &mut subjects {
        fire(args, subject, &mut report)?;
    }
    oracle::hold(args, given, &mut subjects, &mut report)?;
    if let Some(file) = &args.test.json {
        output::write_json(file, &report)?;
    }
    talk::print(&report.text())?;
    match report.failures() {
        0 => Ok(()),
        n => Err(Stop::failed(counted(n, ["disagreement", "disagreements"]))),
    }
}

/// Tests every property on every backend, against `cpu-ref` on one thread.
fn properties(args: &ConformArgs, subjects: &mut [Subject]) -> Result<Vec<PropertyRow>, Stop> {
    let named =
        |p: &&Property| args.property.is_empty() || args.property.iter().any(|n| n == p.name);
    let properties = || PROPERTIES.iter().filter(named);
    let total = subjects.len() * properties().count();
    let numbers = match (args.case, args.cases) {
        (Some(case), _) => case..=case,
        (None, 0) => return Ok(Vec::new()),
        (None, cases) => 0..=cases - 1,
    };
    let cases = Cases::new(args.seed, numbers);
    let mut reference = Reference::new(open::bare(Some(BackendName::CpuRef), None, 1)?);
    let mut progress = Progress::new(total as u64, args.test.quiet);
    let mut rows = Vec::new();
    for subject in &mut *subjects {
        let name = subject.device().backend;
        for property in properties() {
            let begun = Instant::now();
            let backend = subject.as_mut();
            let held = hold(property, backend, &mut reference, &cases);
            let seconds = begun.elapsed().as_secs_f64();
            let row = PropertyRow {
                property: property.name,
                backend: name,
                held: *held.as_ref().unwrap_or_else(|e| &e.held),
                seconds,
                reproduce: held.as_ref().err().map(|e| {
                    let rest = format!("--property {} --case {}", e.property, e.case);
                    command(args, "", name, &rest)
                }),
                disagreement: held.err().map(|e| e.to_string()),
            };
            let so = match row.disagreement {
                None => "held in",
                Some(_) => "failed after",
            };
            let cases = counted(row.held as usize, ["case", "cases"]);
            let line = format!("{name} {}: {so} {cases}", property.name);
            progress.step(&format!("{line}, {seconds:.1} s"));
            if let Some(what) = &row.disagreement {
                progress.say(what);
            }
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Returns the command that reproduces a result.
fn command(args: &ConformArgs, scenes: &str, backend: &str, rest: &str) -> String {
    let adapter = args.test.adapter.as_deref();
    let adapter = adapter.map_or(String::new(), |a| format!(" --adapter '{a}'"));
    let seed = args.seed;
    format!("abvh conform{scenes} --backend {backend}{adapter} --seed {seed} {rest}")
}

/// Aims rays at closed meshes, if requested.
fn fire(args: &ConformArgs, subject: &mut Subject, report: &mut Report) -> Result<(), Stop> {
    if args.leak_rays == 0 {
        return Ok(());
    }
    let intersector = args.intersector.unwrap_or(Intersector::Watertight);
    let plan = LeakPlan {
        seed: args.seed,
        rays: args.leak_rays,
        offsets: OFFSETS.to_vec(),
        intersector,
    };
    let mut progress = Progress::new(STEPS, args.test.quiet);
    let mut told = 0;
    let (name, rays) = (subject.device().backend, args.leak_rays);
    let line = format!("{name} rays at closed bodies");
    let found = leaks::run(subject.as_mut(), &plan, &mut |done| {
        let steps = (u128::from(done) * u128::from(STEPS) / u128::from(plan.rays)) as u64;
        (told..steps).for_each(|_| progress.step(&line));
        told = steps;
    })?;
    drop(progress);
    let rows = found.rows.iter().map(|row| leak_row(name, row));
    report.leaks.extend(rows);
    let rest = format!("--cases 0 --leak-rays {rays} --intersector {intersector}");
    let command = command(args, "", name, &rest);
    let examples = found.first.iter();
    let examples = examples.map(|leak| format!("{name}: {leak}; {command}"));
    report.leak_examples.extend(examples);
    Ok(())
}

/// All results, for JSON and for text.
#[derive(Default, Serialize)]
struct Report {
    #[serde(flatten)]
    tested: Tested,
    seed: u64,
    /// Cases per property.
    cases: u32,
    leak_rays: u64,
    rows: Vec<PropertyRow>,
    /// Counts of rays of one sort at one mesh, by one backend.
    leaks: Vec<Value>,
    /// The first rays that were wrong, each with the command that reproduces it.
    leak_examples: Vec<String>,
    oracle_rays: u64,
    oracle: Vec<OracleRow>,
    /// The first rays with answers other than the oracle's, each with the command that reproduces it.
    oracle_examples: Vec<String>,
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

/// Columns for rays of one sort at one mesh, in the file and in a table.
const LEAKS: &str = "backend body aim side offset rays leaks counted miscounts";

fn leak_row(backend: &str, row: &leaks::LeakRow) -> Value {
    let aim = match row.aim {
        leaks::Aim::Edge => "edge",
        leaks::Aim::Vertex => "vertex",
        leaks::Aim::Random => "random",
    };
    // As few digits as single precision needs.
    let offset: Option<f64> = row.offset.to_string().parse().ok();
    json!({
        "backend": backend,
        "body": row.body,
        "offset": offset,
        "aim": aim,
        "side": if row.inside { "inside" } else { "outside" },
        "rays": row.rays,
        "leaks": row.leaks,
        "counted": row.counted,
        "miscounts": row.miscounts,
    })
}

impl Report {
    /// Returns the number of failed properties, leaking sorts of rays, and kinds of meshes with wrong answers.
    fn failures(&self) -> usize {
        let broken = self.rows.iter().filter(|r| r.disagreement.is_some());
        let leaks = |r: &&Value| r["leaks"] != 0 || r["miscounts"] != 0;
        let leaky = self.leaks.iter().filter(leaks);
        let unlike = self.oracle.iter().filter(|r| r.is_failure());
        broken.count() + leaky.count() + unlike.count()
    }

    fn text(&self) -> String {
        let mut text = self.tested.text.clone();
        if !self.rows.is_empty() {
            text += &self.property_table();
        }
        if !self.leaks.is_empty() {
            text += &self.leak_table();
        }
        text += &oracle::text(&self.oracle);
        for row in &self.rows {
            if let (Some(what), Some(command)) = (&row.disagreement, &row.reproduce) {
                text += &format!("{}: {what}\n    {command}\n", row.backend);
            }
        }
        for example in self.leak_examples.iter().chain(&self.oracle_examples) {
            text += &format!("{example}\n");
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
        // In the order of the tests.
        let mut seen = BTreeSet::new();
        let properties = self
            .rows
            .iter()
            .map(|r| r.property)
            .filter(|&property| seen.insert(property));
        table(properties.map(row), 1)
    }

    fn leak_table(&self) -> String {
        let text = |value: &Value| match value {
            Value::String(text) => text.clone(),
            Value::Number(n) if n.is_u64() => grouped(n.as_u64().unwrap_or(0) as usize),
            other => other.as_f64().unwrap_or(f64::NAN).to_string(),
        };
        let cell = |row: &Value, name| (name, text(&row[name]));
        let cells = |row| LEAKS.split(' ').map(|name| cell(row, name)).collect();
        table(self.leaks.iter().map(cells), 4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(disagreement: Option<&str>) -> Report {
        let row = |backend, property, disagreement: Option<&str>| PropertyRow {
            property,
            backend,
            held: 3,
            disagreement: disagreement.map(str::to_owned),
            reproduce: disagreement.map(|_| "abvh conform --case 3".to_owned()),
            seconds: 0.5,
        };
        let mut tested = Tested::default();
        tested.names.extend(["x", "y"]);
        Report {
            tested,
            // In the order of the tests.
            rows: vec![
                row("x", "a_b", None),
                row("x", "c_d", None),
                row("y", "a_b", disagreement),
            ],
            ..Report::default()
        }
    }

    #[test]
    fn a_disagreement_comes_with_the_command_that_shows_it() {
        let text = report(Some("property a_b: 1 is not 2")).text();
        let words: Vec<_> = text.split(' ').filter(|word| !word.is_empty()).collect();
        let table = words.join(" ");
        assert!(table.contains("a b held 3 DISAGREES") && table.contains("c d held 3 - "));
        let told = "y: property a_b: 1 is not 2\n    abvh conform --case 3\n";
        assert!(text.contains(told), "{text}");
        assert!(!report(None).text().contains("DISAGREES"));
    }

    #[test]
    fn broken_properties_and_leaky_rows_are_failures() {
        assert_eq!(report(None).failures(), 0);
        let mut bad = report(Some("no"));
        let leak = leaks::LeakRow {
            body: "box",
            offset: 10.0,
            aim: leaks::Aim::Edge,
            inside: true,
            rays: 9,
            leaks: 1,
            counted: 2,
            miscounts: 0,
            doubled: 0,
        };
        let tight = leaks::LeakRow { leaks: 0, ..leak };
        bad.leaks = [tight, leak].map(|row| leak_row("x", &row)).to_vec();
        assert_eq!(bad.failures(), 2);
        assert!(bad.text().contains("inside"));
    }
}
