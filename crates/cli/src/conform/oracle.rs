//! Rays by the million against the oracle, on every backend at once.

mod rows;

use super::adapter_option;
use super::results::Report;
use crate::args::ConformArgs;
use crate::progress::Progress;
use crate::stop::Stop;
use crate::subjects::Subject;
use backend::{Intersector, Method};
use conformance::stress::audit::{Audit, AuditCounts, AuditPlan, Batch, BatchSpec, Given};
use rayon::prelude::*;

pub(super) use rows::{OracleRow, text};

/// Rays whose answers are found at a time.
const AHEAD: u64 = 1 << 19;
/// Wrong rays that are told of in full.
const TOLD: usize = 12;

/// The scenes that rays are aimed at, beside those made from the seed.
pub(super) fn open(args: &ConformArgs) -> Result<Vec<Given>, Stop> {
    let options = scene::Options {
        allow_outside: args.allow_outside,
        ..scene::Options::default()
    };
    let all = args.scene.iter();
    all.map(|name| {
        let scene = scene::open(name, &options).map_err(Stop::bad)?;
        Ok(Given {
            name: name.clone(),
            animation: scene.animation,
        })
    })
    .collect()
}

/// Holds every subject that traces our trees to the exact answers, if that was asked for.
pub(super) fn hold(
    args: &ConformArgs,
    given: Vec<Given>,
    subjects: &mut [Subject],
    report: &mut Report,
) -> Result<(), Stop> {
    if args.oracle_rays == 0 {
        return Ok(());
    }
    let mut ours: Vec<&mut Subject> = subjects.iter_mut().collect();
    ours.retain(|s| !s.backend.makes_own_trees());
    if ours.is_empty() {
        let why =
            "a driver that makes its own trees decides what a ray hits: the oracle cannot judge it";
        return Err(Stop::bad(why));
    }
    let (seed, rays) = (args.seed, args.oracle_rays);
    let audit = Audit::new(AuditPlan { seed, rays }, given);
    let specs = specs(args, &audit)?;
    let chunks = chunks(&specs);
    let mut progress = Progress::new(chunks.len() as u64, args.quiet);
    let make =
        |specs: &[BatchSpec]| -> Vec<Batch> { specs.par_iter().map(|l| audit.batch(l)).collect() };
    let mut next = chunks.first().map(|c| make(c));
    for i in 1..=chunks.len() {
        let now = next.take().unwrap_or_default();
        // While the backends answer, the host finds what is right about the next.
        let (asked, after) = rayon::join(
            || ask(args, &audit, &mut ours, &now, report),
            || chunks.get(i).map(|c| make(c)),
        );
        asked?;
        next = after;
        progress.step("rays against exact answers");
    }
    Ok(())
}

/// The batches asked for.
fn specs(args: &ConformArgs, audit: &Audit) -> Result<Vec<BatchSpec>, Stop> {
    let mut specs = audit.specs();
    if let Some(number) = args.oracle_batch {
        specs.retain(|spec| spec.number == number);
        if specs.is_empty() {
            let rays = args.oracle_rays;
            return Err(Stop::bad(format!(
                "of {rays} rays there is no batch {number}"
            )));
        }
    }
    Ok(specs)
}

/// Consecutive batches of about [`AHEAD`] rays together.
fn chunks(specs: &[BatchSpec]) -> Vec<&[BatchSpec]> {
    let mut sum = 0;
    let together = |spec: &BatchSpec, _: &BatchSpec| {
        sum += spec.rays;
        let full = sum >= AHEAD;
        sum = if full { 0 } else { sum };
        !full
    };
    specs.chunk_by(together).collect()
}

/// Asks all subjects all batches.
fn ask(
    args: &ConformArgs,
    audit: &Audit,
    subjects: &mut [&mut Subject],
    batches: &[Batch],
    report: &mut Report,
) -> Result<(), Stop> {
    let intersector = args.intersector.unwrap_or(Intersector::Exact);
    let method = Method {
        intersector,
        ..Method::default()
    };
    for subject in subjects {
        for batch in batches {
            let tally = batch.ask(subject.backend.as_mut(), method)?;
            if intersector == Intersector::Exact {
                tell(args, audit, subject.name, batch, &tally, report);
            }
            let mesh = audit.name(&batch.spec);
            rows::add(&mut report.oracle, subject.name, mesh, intersector, tally);
        }
    }
    Ok(())
}

/// Keeps the first wrong rays of a backend, each with the command that asks it again.
fn tell(
    args: &ConformArgs,
    audit: &Audit,
    backend: &str,
    batch: &Batch,
    tally: &AuditCounts,
    report: &mut Report,
) {
    let (about, spec) = (audit.about(&batch.spec), batch.spec.number);
    let scenes: String = args.scene.iter().map(|s| format!(" '{s}'")).collect();
    let command = format!(
        "abvh conform{scenes} --backend {backend}{} --seed {} --cases 0 --oracle-rays {} --oracle-batch {spec}",
        adapter_option(args),
        args.seed,
        args.oracle_rays,
    );
    let examples = &mut report.oracle_examples;
    let begins = format!("{backend}: ");
    let told = examples.iter().filter(|e| e.starts_with(&begins)).count();
    let more = tally.first.iter().take(TOLD.saturating_sub(told));
    examples.extend(more.map(|wrong| format!("{begins}{about}: {wrong}\n    {command}")));
}
