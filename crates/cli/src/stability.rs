//! `abvh stability`: how often each intersector is wrong where arithmetic is hardest, and whether that is to be expected.

mod results;

use crate::args::StabilityArgs;
use crate::progress::Progress;
use crate::stop::Stop;
use crate::subjects::{self, Examined, Machine, Subject};
use crate::{conflicts, talk};
use backend::Intersector;
use conformance::stress::{Cell, Family, Plan, StressTest, baseline};
use results::{Report, Row, Unsupported};
use std::path::Path;
use std::time::Instant;

/// Asks everything of all.
pub(crate) fn run(args: &StabilityArgs) -> Result<(), Stop> {
    let written = [
        ("--json", args.json.as_ref()),
        ("--record", args.record.as_ref()),
    ];
    conflicts::of_files(&[], [], written)?;
    for file in args.json.iter().chain(&args.record) {
        output::check_writable(file).map_err(Stop::bad)?;
    }
    if args.backend.iter().any(|&s| subjects::is_driver(s)) {
        let why = "stability knows no bounds for intersections that a driver decides; conform holds them to rounding";
        return Err(Stop::bad(why));
    }
    let (mut subjects, absent) = subjects::open_all(&args.backend, false, args.adapter.as_deref())?;
    if let Some(file) = &args.record {
        return record(args, &mut subjects, file);
    }
    let mut report = Report {
        schema: output::SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command_line: std::env::args().collect(),
        seed: args.seed,
        rays: args.rays,
        machine: Machine::here(),
        backends: subjects.iter().map(Examined::of).collect(),
        absent,
        unsupported: Vec::new(),
        rows: Vec::new(),
    };
    ask(args, &mut subjects, &mut report)?;
    if let Some(file) = &args.json {
        output::write_json(file, &report)?;
    }
    let known = Intersector::ALL.into_iter();
    let asked: Vec<_> = known.filter(|i| args.intersector.contains(i)).collect();
    talk::print(&report.text(&asked))?;
    match report.failures() {
        0 => Ok(()),
        1 => Err(Stop::failed("1 cell is out of its bound")),
        n => Err(Stop::failed(format!("{n} cells are out of their bounds"))),
    }
}

/// Measures what is to be expected of the one backend.
fn record(args: &StabilityArgs, subjects: &mut [Subject], file: &Path) -> Result<(), Stop> {
    let [subject] = subjects else {
        let names: Vec<_> = subjects.iter().map(|s| s.name).collect();
        return Err(Stop::bad(format!(
            "--record measures one backend, but there are {}; name one with --backend",
            names.join(", ")
        )));
    };
    let mut progress = Progress::new(Family::ALL.len() as u64, args.quiet);
    let found = baseline::record(subject.backend.as_mut(), args.seeds, &mut |family| {
        progress.step(&format!("{} {family}", subject.name));
    })?;
    output::write_json(file, &found)?;
    let rates = found.entries.len();
    talk::print(&format!("{rates} rates of {}\n", found.ground))
}

/// Every family, by every intersector, of every backend.
fn ask(args: &StabilityArgs, subjects: &mut [Subject], report: &mut Report) -> Result<(), Stop> {
    let plan = Plan {
        seed: args.seed,
        rays: args.rays,
    };
    let mut progress = Progress::new((Family::ALL.len() * subjects.len()) as u64, args.quiet);
    for family in Family::ALL {
        let test = StressTest::new(family, &plan);
        for subject in &mut *subjects {
            for by in Intersector::ALL {
                if args.intersector.contains(&by) {
                    report.add(subject.name, by, answer(&test, subject, by)?);
                }
            }
            progress.step(&format!("{} {family}", subject.name));
        }
    }
    Ok(())
}

/// One cell; `None` if the backend does not support the intersector.
fn answer(test: &StressTest, subject: &mut Subject, by: Intersector) -> Result<Option<Row>, Stop> {
    let begun = Instant::now();
    let arithmetic = subject.backend.device().arithmetic;
    let tally = test.ask(subject.backend.as_mut(), by)?;
    let seconds = begun.elapsed().as_secs_f64();
    Ok(tally.map(|tally| {
        let cell = Cell::new(test.family(), by, &tally, arithmetic);
        Row::new(subject.name, cell, seconds)
    }))
}

impl Report {
    fn add(&mut self, backend: &'static str, by: Intersector, row: Option<Row>) {
        let unsupported = Unsupported {
            backend,
            intersector: by.name(),
        };
        match row {
            Some(row) => self.rows.push(row),
            None if self.unsupported.contains(&unsupported) => {}
            None => self.unsupported.push(unsupported),
        }
    }
}
