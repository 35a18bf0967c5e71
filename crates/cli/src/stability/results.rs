//! What `stability` found, as JSON and for people.

use crate::subjects::{Absent, Examined, Machine, roll};
use crate::table::{grouped, table};
use backend::Intersector;
use conformance::stress::{Cell, Family, Measure, Measured};
use serde::Serialize;

#[derive(Serialize)]
pub(super) struct Report {
    pub(super) schema: u32,
    pub(super) version: &'static str,
    pub(super) command_line: Vec<String>,
    pub(super) seed: u64,
    /// Of each family.
    pub(super) rays: u32,
    pub(super) machine: Machine,
    pub(super) backends: Vec<Examined>,
    pub(super) absent: Vec<Absent>,
    /// Cells that there cannot be.
    pub(super) unsupported: Vec<Unsupported>,
    pub(super) rows: Vec<Row>,
}

/// What a backend cannot do.
#[derive(PartialEq, Serialize)]
pub(super) struct Unsupported {
    pub(super) backend: &'static str,
    pub(super) intersector: &'static str,
}

/// One family, by one intersector, of one backend.
#[derive(Serialize)]
pub(super) struct Row {
    family: &'static str,
    backend: &'static str,
    intersector: &'static str,
    rays: u64,
    /// Answers that are not the exact ones.
    wrong: u64,
    rate: f64,
    /// The rates to be expected.
    bound: Option<[f64; 2]>,
    /// Whether this and whatever else was counted is within its bound.
    ok: bool,
    /// Of closed bodies alone: rays from inside that meet nothing.
    leaks: Option<Count>,
    /// Of closed bodies alone: rays that cross them too often or not often enough.
    double_hits: Option<Count>,
    /// Of rearranged scenes alone: answers that differ with the tree.
    tree_dependent: Option<Count>,
    /// Of rearranged scenes alone: cost of the refitted tree over that of a new one.
    sah_ratio: Option<f64>,
    seconds: f64,
    #[serde(skip)]
    cell: Cell,
}

#[derive(Serialize)]
struct Count {
    rays: u64,
    count: u64,
    rate: f64,
    bound: Option<[f64; 2]>,
    ok: bool,
}

impl Count {
    fn of(m: &Measured) -> Self {
        Self {
            rays: m.of,
            count: m.count,
            rate: m.rate(),
            bound: m.bound,
            ok: m.is_ok(),
        }
    }
}

impl Row {
    pub(super) fn new(backend: &'static str, cell: Cell, seconds: f64) -> Self {
        let count = |measure| cell.get(measure).map(Count::of);
        let wrong = Count::of(cell.wrong());
        Self {
            family: cell.family.name(),
            backend,
            intersector: cell.intersector.name(),
            rays: wrong.rays,
            wrong: wrong.count,
            rate: wrong.rate,
            bound: wrong.bound,
            ok: cell.is_ok(),
            leaks: count(Measure::Leaks),
            double_hits: count(Measure::DoubleHits),
            tree_dependent: count(Measure::TreeDependent),
            sah_ratio: cell.sah_ratio,
            seconds,
            cell,
        }
    }
}

impl Report {
    /// Cells of which something is out of its bound.
    pub(super) fn failures(&self) -> usize {
        self.rows.iter().filter(|r| !r.ok).count()
    }

    pub(super) fn text(&self, asked: &[Intersector]) -> String {
        let mut text = roll(&self.backends, &self.absent);
        for b in &self.backends {
            text += &self.tables(b.backend, asked);
        }
        for row in self.rows.iter().filter(|r| !r.ok) {
            text += &self.complaint(row);
        }
        text
    }

    /// Families down, intersectors across: first what is wrong, then what leaks and what is hit twice.
    fn tables(&self, backend: &str, asked: &[Intersector]) -> String {
        let mut head = vec!["wrong"];
        head.extend(asked.iter().map(|i| i.name()));
        let mut text = format!("\n{backend}, rays of each family: {}\n", self.rays);
        text += &self.table(backend, &head, asked, &|r| share(r.cell.wrong()));
        head[0] = "leaks, double hits";
        text += &self.table(backend, &head, asked, &|r| {
            let [leaks, doubles] = [Measure::Leaks, Measure::DoubleHits].map(|m| r.cell.get(m));
            leaks.zip(doubles).map_or(String::new(), |(l, d)| {
                format!("{}, {}", share(l), share(d))
            })
        });
        let mut of_backend = self.rows.iter().filter(|r| r.backend == backend);
        let moved = of_backend.find_map(|r| r.sah_ratio);
        text + &moved.map_or(String::new(), |ratio| {
            format!("rearranged: a refitted tree costs {ratio:.1} times a new one (SAH)\n")
        })
    }

    /// Families of which `cell` has something to say.
    fn table(
        &self,
        backend: &str,
        head: &[&str],
        asked: &[Intersector],
        cell: &dyn Fn(&Row) -> String,
    ) -> String {
        let mut rows = Vec::new();
        for family in Family::ALL {
            let cells: Vec<String> = asked
                .iter()
                .map(|by| {
                    let this = |r: &&Row| {
                        r.backend == backend && r.cell.family == family && r.cell.intersector == *by
                    };
                    self.rows.iter().find(this).map_or("-".to_owned(), cell)
                })
                .collect();
            if cells.iter().any(|c| !c.is_empty() && c != "-") {
                rows.push([vec![family.name().to_owned()], cells].concat());
            }
        }
        if rows.is_empty() {
            return String::new();
        }
        table(head, &rows, 1)
    }

    /// What is out of its bound, and the command that shows it again.
    fn complaint(&self, row: &Row) -> String {
        let (backend, by) = (row.backend, row.intersector);
        let out = row.cell.measured.iter().filter(|m| !m.is_ok());
        let out: Vec<String> = out
            .map(|m| {
                let expected = match m.bound {
                    Some([_, 0.0]) => "none".to_owned(),
                    Some([low, high]) => format!("{} to {}", percent(low), percent(high)),
                    None => "nobody knows what; abvh stability --record measures it".to_owned(),
                };
                format!(
                    "{} {} of {} ({}), expected {expected}",
                    m.measure.name().replace('_', " "),
                    grouped(m.count as usize),
                    grouped(m.of as usize),
                    percent(m.rate()),
                )
            })
            .collect();
        format!(
            "{backend} {by} {}: {}\n    abvh stability --backend {backend} --intersector {by} --seed {} --rays {}\n",
            row.family,
            out.join("; "),
            self.seed,
            self.rays
        )
    }
}

/// A rate with its count, marked if it is out of its bound.
fn share(m: &Measured) -> String {
    let text = match m.count {
        0 => "0".to_owned(),
        n => format!("{} {}", percent(m.rate()), grouped(n as usize)),
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
    use conformance::stress::{Closed, StressCounts};

    fn report(wrong: u64, leaks: u64, by: Intersector) -> Report {
        let closed = Closed {
            inside: 1000,
            leaks,
            counted: 2000,
            doubles: 0,
        };
        let tally = StressCounts {
            rays: 2000,
            wrong,
            closed: Some(closed),
            rearranged: None,
        };
        let cell = Cell::new(Family::Edges, by, &tally, Arithmetic::IEEE);
        Report {
            schema: 1,
            version: "0",
            command_line: Vec::new(),
            seed: 9,
            rays: 2000,
            machine: Machine {
                cpu: None,
                cores: 1,
                os: "",
            },
            backends: Vec::new(),
            absent: Vec::new(),
            unsupported: Vec::new(),
            rows: vec![Row::new("x", cell, 0.5)],
        }
    }

    #[test]
    fn what_never_may_be_is_a_failure_with_the_command_that_shows_it() {
        let sound = report(0, 0, Intersector::Exact);
        assert_eq!(
            (sound.failures(), sound.text(&Intersector::ALL)),
            (0, String::new())
        );
        let bad = report(1, 2, Intersector::Exact);
        assert_eq!(bad.failures(), 1);
        let text = bad.text(&Intersector::ALL) + &bad.tables("x", &Intersector::ALL);
        for part in [
            "x exact edges: wrong 1 of 2,000 (0.050%), expected none; leaks 2 of 1,000 (0.200%), expected none\n",
            "\n    abvh stability --backend x --intersector exact --seed 9 --rays 2000\n",
            "WORSE 0.050% 1",
            "WORSE 0.200% 2, 0",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn success_that_nobody_expects_is_a_failure_too() {
        let bad = report(0, 0, Intersector::Woop);
        assert_eq!(bad.failures(), 1);
        assert!(bad.tables("x", &[Intersector::Woop]).contains("BETTER 0"));
    }
}
