//! Compares the hits of every backend with the oracle's exact hits. The backends trace with the intersector `exact`.

use super::{ConformReport, ConformSettings};
use crate::console::ProgressLine;
use crate::error::CliError;
use crate::table::{Cells, grouped, table};
use backend::{Backend, Intersector};
use conformance::stability::audit::{Audit, AuditBatch, AuditCounts, BatchSpec};
use rayon::prelude::*;
use serde::Serialize;

/// Number of rays whose exact answers are computed at a time.
const AHEAD: u64 = 1 << 19;
/// Maximum number of wrong rays per backend that are reported in full.
const MOST_EXAMPLES: usize = 12;

/// Compares every backend with exact answers.
pub(super) fn compare(
    settings: &ConformSettings,
    backends: &mut [Box<dyn Backend>],
    report: &mut ConformReport,
) -> Result<(), CliError> {
    let audit = Audit {
        seed: settings.seed,
        rays: settings.oracle_rays,
    };
    let specs = audit.specs();
    let chunks = chunks(&specs);
    let mut progress = ProgressLine::new(chunks.len() as u64, settings.test.quiet);
    let make = |specs: &[BatchSpec]| specs.par_iter().map(|spec| audit.batch(spec)).collect();
    let mut now: Vec<AuditBatch> = chunks.first().map_or(Vec::new(), |c| make(c));
    for i in 1..=chunks.len() {
        // While the backends trace a chunk, the host computes the exact answers of the next.
        let (traced, next) = rayon::join(
            || {
                backends
                    .iter_mut()
                    .try_for_each(|b| trace(settings, b.as_mut(), &now, report))
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

/// Traces batches on a backend and counts wrong answers. Adds its first wrong rays to the report, with the command that
/// reproduces them.
fn trace(
    settings: &ConformSettings,
    backend: &mut dyn Backend,
    batches: &[AuditBatch],
    report: &mut ConformReport,
) -> Result<(), CliError> {
    let name = backend.device().backend;
    let rest = format!("--cases 0 --oracle-rays {}", settings.oracle_rays);
    let command = settings.command(name, &rest);
    let begins = format!("{name}: ");
    for batch in batches {
        let tally = batch.run(backend, Intersector::Exact)?;
        let mesh = batch.spec.kind.name();
        let examples = &mut report.oracle_examples;
        let known = examples.iter().filter(|e| e.starts_with(&begins)).count();
        let more = tally.first.iter().take(MOST_EXAMPLES.saturating_sub(known));
        examples.extend(more.map(|wrong| format!("{begins}{mesh}: {wrong}\n    {command}")));
        let row = OracleRow {
            backend: name,
            mesh,
            scenes: 1,
            tally,
        };
        add(&mut report.oracle, row);
    }
    Ok(())
}

/// Counts of all rays that one backend traced against meshes of one kind.
#[derive(Clone, Serialize)]
pub(super) struct OracleRow {
    backend: &'static str,
    mesh: &'static str,
    /// Number of meshes of this kind.
    scenes: u64,
    #[serde(flatten)]
    tally: AuditCounts,
}

impl OracleRow {
    /// Returns whether any answer is wrong.
    pub(super) fn is_failure(&self) -> bool {
        self.tally.wrong + self.tally.wrong_any + self.tally.wrong_t > 0
    }

    fn cells(&self) -> Cells<'static> {
        let t = &self.tally;
        let count = |n: u64| grouped(n as usize);
        vec![
            ("backend", self.backend.to_owned()),
            ("mesh", self.mesh.to_owned()),
            ("scenes", count(self.scenes)),
            ("rays", count(t.rays)),
            ("hits", count(t.hits)),
            ("ties", count(t.ties)),
            ("on edges", count(t.edges)),
            ("exact tests", count(t.settled)),
            ("wrong", count(t.wrong)),
            ("any-hit wrong", count(t.wrong_any)),
            ("t wrong", count(t.wrong_t)),
        ]
    }
}

/// Adds the counts of `row` to the row of its backend and mesh.
fn add(rows: &mut Vec<OracleRow>, row: OracleRow) {
    let same = |r: &&mut OracleRow| (r.backend, r.mesh) == (row.backend, row.mesh);
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
    if rows.is_empty() {
        return String::new();
    }
    let mut all = Vec::new();
    for of_backend in rows.chunk_by(|a, b| a.backend == b.backend) {
        let mut sum = OracleRow {
            mesh: "all",
            ..of_backend[0].clone()
        };
        for row in &of_backend[1..] {
            sum.scenes += row.scenes;
            sum.tally += row.tally.clone();
        }
        all.extend(of_backend.iter().chain([&sum]).map(OracleRow::cells));
    }
    table(all, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(wrong: u64) -> Vec<OracleRow> {
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
                mesh,
                scenes: 1,
                tally,
            };
            add(&mut rows, row);
        }
        rows
    }

    #[test]
    fn sums_scene_kinds_and_backends() {
        let rows = rows(3);
        let sums: Vec<u64> = rows.iter().map(|r| r.tally.rays).collect();
        assert_eq!(sums, [2000, 1000, 1000]);
        let text = text(&rows);
        for part in ["3,000", "2,100"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn wrong_answers_fail() {
        let failures = |wrong| rows(wrong).iter().filter(|r| r.is_failure()).count();
        assert_eq!([failures(0), failures(1)], [0, 3]);
    }
}
