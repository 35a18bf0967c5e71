//! What became of rays that were held to the oracle.

use crate::table::{grouped, table};
use backend::Intersector;
use conformance::stress::audit::AuditCounts;
use serde::Serialize;

/// All rays at meshes of one kind, or at one scene.
#[derive(Clone, Serialize)]
pub(in crate::conform) struct OracleRow {
    backend: &'static str,
    mesh: String,
    intersector: &'static str,
    /// Meshes of this kind, or moments of this scene.
    scenes: u64,
    #[serde(flatten)]
    tally: AuditCounts,
}

impl OracleRow {
    /// `exact` errs nowhere; what others do is only counted.
    pub(in crate::conform) fn is_failure(&self) -> bool {
        let wrong = self.tally.wrong + self.tally.wrong_any + self.tally.wrong_t;
        self.intersector == Intersector::Exact.name() && wrong > 0
    }

    fn cells(&self) -> Vec<String> {
        let t = &self.tally;
        let counts = [
            self.scenes,
            t.rays,
            t.hits,
            t.ties,
            t.edges,
            t.degenerate,
            t.settled,
            t.wrong,
            t.wrong_any,
            t.wrong_t,
        ];
        let words = [self.backend, &self.mesh].map(str::to_owned).into_iter();
        let counts = counts.iter().map(|&n| grouped(n as usize));
        let per_million = 1e6 * t.wrong as f64 / t.rays.max(1) as f64;
        let rate = std::iter::once(format!("{per_million:.1}"));
        words.chain(counts).chain(rate).collect()
    }
}

/// Adds a scene's rays to the row of its backend and mesh.
pub(super) fn add(
    rows: &mut Vec<OracleRow>,
    backend: &'static str,
    mesh: &str,
    by: Intersector,
    tally: AuditCounts,
) {
    let same = |r: &OracleRow| (r.backend, &*r.mesh) == (backend, mesh);
    let at = rows.iter().position(same).unwrap_or_else(|| {
        // Below those of the same backend.
        let last = rows.iter().rposition(|r| r.backend == backend);
        let at = last.map_or(rows.len(), |last| last + 1);
        let row = OracleRow {
            backend,
            mesh: mesh.to_owned(),
            intersector: by.name(),
            scenes: 0,
            tally: AuditCounts::default(),
        };
        rows.insert(at, row);
        at
    });
    rows[at].scenes += 1;
    rows[at].tally += tally;
}

/// Backends one below the other, each with the sum of all its rows; nothing where there are none.
pub(in crate::conform) fn text(rows: &[OracleRow]) -> String {
    let Some(first) = rows.first() else {
        return String::new();
    };
    let wrong = format!("{} wrong", first.intersector);
    let head = [
        "backend",
        "mesh",
        "scenes",
        "rays",
        "hits",
        "ties",
        "on edges",
        "degenerate",
        "settled",
        &wrong,
        "any-hit wrong",
        "t wrong",
        "per million",
    ];
    let mut all = Vec::new();
    for of_backend in rows.chunk_by(|a, b| a.backend == b.backend) {
        all.extend(of_backend.iter().map(OracleRow::cells));
        all.push(sum(of_backend).cells());
    }
    table(&head, &all, 2)
}

fn sum(rows: &[OracleRow]) -> OracleRow {
    let mut sum = OracleRow {
        mesh: "all".to_owned(),
        scenes: 0,
        tally: AuditCounts::default(),
        ..rows[0].clone()
    };
    for row in rows {
        sum.scenes += row.scenes;
        sum.tally += row.tally.clone();
    }
    sum
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
            add(&mut rows, backend, mesh, by, tally);
        }
        rows
    }

    #[test]
    fn scenes_of_one_kind_are_summed_and_backends_too() {
        let rows = rows(Intersector::Watertight, 3);
        let sums: Vec<u64> = rows.iter().map(|r| r.tally.rays).collect();
        assert_eq!(sums, [2000, 1000, 1000]);
        let text = text(&rows);
        for part in ["watertight wrong", "3,000", "3000.0", "2,100"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn a_wrong_answer_is_a_failure_of_exact_alone() {
        let failures = |by, wrong| rows(by, wrong).iter().filter(|r| r.is_failure()).count();
        assert_eq!(failures(Intersector::Exact, 1), 3);
        assert_eq!(failures(Intersector::Exact, 0), 0);
        assert_eq!(failures(Intersector::Watertight, 1), 0);
    }
}
