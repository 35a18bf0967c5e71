//! `abvh conform`: every law on every backend, on the user's own machine.

mod oracle;
mod results;

use crate::args::{BackendName, ConformArgs};
use crate::conflicts::Files;
use crate::open;
use crate::stop::Stop;
use crate::subjects::{self, Subject};
use crate::table::counted;
use crate::talk;
use crate::talk::Progress;
use backend::{Intersector, Method};
use conformance::leaks::{self, LeakPlan, OFFSETS};
use conformance::{Law, Reference, hold, laws_of};
use results::{PropertyRow, Report, leak_row};
use std::time::Instant;

/// Steps in which the progress of many rays is told.
const STEPS: u64 = 20;

pub(crate) fn run(args: &ConformArgs) -> Result<(), Stop> {
    Files::written(&[("--json", &args.test.json)]).check(&args.scene)?;
    let given = oracle::open(args)?;
    let (mut subjects, tested) = subjects::open_all(&args.test, true)?;
    let mut report = Report {
        tested,
        seed: args.seed,
        cases: args.cases,
        leak_rays: args.leak_rays,
        rows: laws(args, &mut subjects)?,
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

/// Every law on every subject, against the host on one thread.
fn laws(args: &ConformArgs, subjects: &mut [Subject]) -> Result<Vec<PropertyRow>, Stop> {
    let named = |l: &&Law| args.law.is_empty() || args.law.iter().any(|n| n == l.name);
    let laws = |s: &Subject| laws_of(s.backend.as_ref()).iter().filter(named);
    let total: usize = subjects.iter().map(|s| laws(s).count()).sum();
    let cases = match (args.case, args.cases) {
        (Some(case), _) => case..=case,
        (None, 0) => return Ok(Vec::new()),
        (None, cases) => 0..=cases - 1,
    };
    let mut reference = Reference::new(open::bare(BackendName::Cpu, None, 1)?);
    let mut progress = Progress::new(total as u64, args.test.quiet);
    let mut rows = Vec::new();
    for subject in &mut *subjects {
        for law in laws(subject) {
            let begun = Instant::now();
            let backend = subject.backend.as_mut();
            let held = hold(law, backend, &mut reference, args.seed, cases.clone());
            let seconds = begun.elapsed().as_secs_f64();
            let row = PropertyRow {
                law: law.name,
                backend: subject.name,
                held: *held.as_ref().unwrap_or_else(|e| &e.held),
                seconds,
                reproduce: held.as_ref().err().map(|e| {
                    let rest = format!("--law {} --case {}", e.law, e.case);
                    command(args, "", subject.name, &rest)
                }),
                disagreement: held.err().map(|e| e.to_string()),
            };
            let so = match row.disagreement {
                None => "held in",
                Some(_) => "failed after",
            };
            let cases = counted(row.held as usize, ["case", "cases"]);
            let line = format!("{} {}: {so} {cases}", subject.name, law.name);
            progress.step(&format!("{line}, {seconds:.1} s"));
            if let Some(what) = &row.disagreement {
                progress.say(what);
            }
            rows.push(row);
        }
    }
    Ok(rows)
}

/// The command that shows something again.
fn command(args: &ConformArgs, scenes: &str, backend: &str, rest: &str) -> String {
    let adapter = args.test.adapter.as_deref();
    let adapter = adapter.map_or(String::new(), |a| format!(" --adapter '{a}'"));
    let seed = args.seed;
    format!("abvh conform{scenes} --backend {backend}{adapter} --seed {seed} {rest}")
}

/// Aims rays at closed bodies, if that was asked for.
fn fire(args: &ConformArgs, subject: &mut Subject, report: &mut Report) -> Result<(), Stop> {
    if args.leak_rays == 0 {
        return Ok(());
    }
    let intersector = args.intersector.unwrap_or(Intersector::Watertight);
    let plan = LeakPlan {
        seed: args.seed,
        rays: args.leak_rays,
        offsets: OFFSETS.to_vec(),
        method: Method {
            intersector,
            ..Method::default()
        },
    };
    let mut progress = Progress::new(STEPS, args.test.quiet);
    let mut told = 0;
    let line = format!("{} rays at closed bodies", subject.name);
    let found = leaks::run(subject.backend.as_mut(), &plan, &mut |done| {
        let steps = (u128::from(done) * u128::from(STEPS) / u128::from(plan.rays)) as u64;
        (told..steps).for_each(|_| progress.step(&line));
        told = steps;
    })?;
    drop(progress);
    let rows = found.rows.iter().map(|row| leak_row(subject.name, row));
    report.leaks.extend(rows);
    let rays = args.leak_rays;
    let rest = format!("--cases 0 --leak-rays {rays} --intersector {intersector}");
    let command = command(args, "", subject.name, &rest);
    let examples = found.first.iter();
    report
        .leak_examples
        .extend(examples.map(|leak| format!("{}: {leak}; {command}", subject.name)));
    Ok(())
}
