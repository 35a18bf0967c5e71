//! Millions of rays against the oracle, on every backend.

use super::{ConformReport, ConformSettings};
use crate::console::Progress;
use crate::stop::Stop;
use crate::table::{Cells, grouped, table};
use backend::{Backend, Intersector};
use conformance::stress::audit::{Audit, AuditBatch, AuditCounts, BatchSpec};
use geom::Animation;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// Number of rays whose exact answers are computed at a time.
const AHEAD: u64 = 1 << 19;
/// Maximum number of wrong rays per backend that are reported in full.
const MOST_EXAMPLES: usize = 12;

/// A scene and its name.
type NamedScene = (String, Arc<Animation>);

pub(super) fn open_scenes(settings: &ConformSettings) -> Result<Vec<NamedScene>, Stop> {
    let options = scene::Options {
        allow_outside: settings.allow_outside,
        ..scene::Options::default()
    };
    let open = |name: &String| {
        let scene = scene::open(name, &options).map_err(Stop::bad)?;
        Ok((name.clone(), scene.animation))
    };
    settings.scene.iter().map(open).collect()
}

/// Compares every backend with exact answers.
pub(super) fn compare(
    settings: &ConformSettings,
    scenes: Vec<NamedScene>,
    backends: &mut [Box<dyn Backend>],
    report: &mut ConformReport,
) -> Result<(), Stop> {
    let rays = settings.oracle_rays;
    let audit = Audit::new(settings.seed, rays, scenes);
    let mut specs = audit.specs();
    let test = OracleTest { settings, audit };
    if let Some(number) = settings.oracle_batch {
        specs.retain(|spec| spec.number == number);
        if specs.is_empty() {
            let why = format!("of {rays} rays there is no batch {number}");
            return Err(Stop::bad(why));
        }
    }
    let chunks = chunks(&specs);
    let mut progress = Progress::new(chunks.len() as u64, settings.test.quiet);
    let make = |specs: &[BatchSpec]| {
        specs
            .par_iter()
            .map(|spec| test.audit.batch(spec))
            .collect()
    };
    let mut now: Vec<AuditBatch> = chunks.first().map_or(Vec::new(), |c| make(c));
    for i in 1..=chunks.len() {
        // While the backends trace a chunk, the host computes the exact answers of the next.
        let (traced, next) = rayon::join(
            || {
                backends
                    .iter_mut()
                    .try_for_each(|b| test.trace(b.as_mut(), &now, report))
            },
            || chunks.get(i).map_or(Vec::new(), |c| make(c)),
        );
        traced?;
        now = next;
        progress.step("rays against exact answers");
    }
    Ok(())
}

/// Splits batches into consecutive chunks of about [`AHEAD`] rays.
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

/// Rays with exact answers.
struct OracleTest<'a> {
    settings: &'a ConformSettings,
    audit: Audit,
}

impl OracleTest<'_> {
    /// Traces batches on a backend. With `exact`, keeps its first wrong rays with the command that reproduces them.
    fn trace(
        &self,
        backend: &mut dyn Backend,
        batches: &[AuditBatch],
        report: &mut ConformReport,
    ) -> Result<(), Stop> {
        let Self { settings, audit } = self;
        let intersector = settings.intersector.unwrap_or(Intersector::Exact);
        let scenes: String = settings.scene.iter().map(|s| format!(" '{s}'")).collect();
        let most = usize::from(intersector == Intersector::Exact) * MOST_EXAMPLES;
        let name = backend.device().backend;
        let begins = format!("{name}: ");
        for batch in batches {
            let tally = batch.ask(backend, intersector)?;
            let (mesh, number) = (audit.name(&batch.spec), batch.spec.number);
            let rays = settings.oracle_rays;
            let rest = format!("--cases 0 --oracle-rays {rays} --oracle-batch {number}");
            let command = settings.command(&scenes, name, &rest);
            let examples = &mut report.oracle_examples;
            let known = examples.iter().filter(|e| e.starts_with(&begins)).count();
            let more = tally.first.iter().take(most.saturating_sub(known));
            examples.extend(more.map(|wrong| format!("{begins}{mesh}: {wrong}\n    {command}")));
            let row = OracleRow {
                backend: name,
                mesh: mesh.to_owned(),
                intersector: intersector.name(),
                scenes: 1,
                tally,
            };
            add(&mut report.oracle, row);
        }
        Ok(())
    }
}

/// Counts of all rays at meshes of one kind, or at one scene.
#[derive(Clone, Serialize)]
pub(super) struct OracleRow {
    backend: &'static str,
    mesh: String,
    intersector: &'static str,
    /// Number of meshes of this kind, or of times of this scene.
    scenes: u64,
    #[serde(flatten)]
    tally: AuditCounts,
}

impl OracleRow {
    /// Returns whether the row is a failure. Wrong answers of other intersectors than `exact` are only counted.
    pub(super) fn is_failure(&self) -> bool {
        let wrong = self.tally.wrong + self.tally.wrong_any + self.tally.wrong_t;
        self.intersector == Intersector::Exact.name() && wrong > 0
    }

    /// Formats the row. `wrong` names the column of the intersector's wrong answers.
    fn cells<'a>(&self, wrong: &'a str) -> Cells<'a> {
        let t = &self.tally;
        let count = |n: u64| grouped(n as usize);
        let per_million = 1e6 * t.wrong as f64 / t.rays.max(1) as f64;
        vec![
            ("backend", self.backend.to_owned()),
            ("mesh", self.mesh.clone()),
            ("scenes", count(self.scenes)),
            ("rays", count(t.rays)),
            ("hits", count(t.hits)),
            ("ties", count(t.ties)),
            ("on edges", count(t.edges)),
            ("settled", count(t.settled)),
            (wrong, count(t.wrong)),
            ("any-hit wrong", count(t.wrong_any)),
            ("t wrong", count(t.wrong_t)),
            ("per million", format!("{per_million:.1}")),
        ]
    }
}

/// Adds the counts of `row` to the row of its backend and mesh.
fn add(rows: &mut Vec<OracleRow>, row: OracleRow) {
    let same = |r: &&mut OracleRow| (r.backend, &r.mesh) == (row.backend, &row.mesh);
    if let Some(sum) = rows.iter_mut().find(same) {
        sum.scenes += row.scenes;
        sum.tally += row.tally;
    } else {
        // Insert after the rows of the same backend.
        let last = rows.iter().rposition(|r| r.backend == row.backend);
        let at = last.map_or(rows.len(), |last| last + 1);
        rows.insert(at, row);
    }
}

/// Formats the rows of each backend, with their sum. Empty without rows.
pub(super) fn text(rows: &[OracleRow]) -> String {
    let Some(first) = rows.first() else {
        return String::new();
    };
    let wrong = format!("{} wrong", first.intersector);
    let mut all = Vec::new();
    for of_backend in rows.chunk_by(|a, b| a.backend == b.backend) {
        let mut sum = OracleRow {
            mesh: "all".to_owned(),
            ..of_backend[0].clone()
        };
        for row in &of_backend[1..] {
            sum.scenes += row.scenes;
            sum.tally += row.tally.clone();
        }
        all.extend(of_backend.iter().chain([&sum]).map(|row| row.cells(&wrong)));
    }
    table(all, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(by: Intersector, wrong: u64) -> Vec<OracleRow> {
        let mut rows = Vec::new();
        for (backend, mesh) in [("x", "soup"), ("x", "soup"), ("y", "soup"), ("x", "fan")] {
            let tally = AuditCounts {
                rays: 1000,
                hits: 700,
                wrong,
                ..AuditCounts::default()
            };
            let row = OracleRow {
                backend,
                mesh: mesh.to_owned(),
                intersector: by.name(),
                scenes: 1,
                tally,
            };
            add(&mut rows, row);
        }
        rows
    }

    #[test]
    fn sums_scene_kinds_and_backends() {
        let rows = rows(Intersector::Watertight, 3);
        let sums: Vec<u64> = rows.iter().map(|r| r.tally.rays).collect();
        assert_eq!(sums, [2000, 1000, 1000]);
        let text = text(&rows);
        for part in ["watertight wrong", "3,000", "3000.0", "2,100"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn only_exact_fails_on_wrong_hits() {
        let failures = |by, wrong| rows(by, wrong).iter().filter(|r| r.is_failure()).count();
        assert_eq!(failures(Intersector::Exact, 1), 3);
        assert_eq!(failures(Intersector::Exact, 0), 0);
        assert_eq!(failures(Intersector::Watertight, 1), 0);
    }
}
