//! `abvh stability`: how often each intersector is wrong in numerically hard cases, compared with baselines.

use crate::args::StabilityArgs;
use crate::conflicts::Files;
use crate::open::{self, Subject, Tested};
use crate::stop::Stop;
use crate::table::{grouped, table};
use crate::talk;
use crate::talk::Progress;
use backend::Intersector;
use conformance::stress::{Cell, Family, Measure, Measured, Plan, StressTest, baseline};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

pub(crate) fn run(args: &StabilityArgs) -> Result<(), Stop> {
    Files::written(&[("--json", &args.test.json), ("--record", &args.record)]).check(&[])?;
    if args.test.backend.iter().any(|&b| open::has_own_trees(b)) {
        let why = "stability knows no bounds for intersections that a driver decides; conform holds them to rounding";
        return Err(Stop::bad(why));
    }
    let (mut subjects, tested) = open::open_all(&args.test, false)?;
    if let Some(file) = &args.record {
        return record_rates(args, &mut subjects, file);
    }
    let mut report = Report {
        tested,
        seed: args.seed,
        rays: args.rays,
        ..Report::default()
    };
    let known = Intersector::ALL.into_iter();
    let asked: Vec<_> = known.filter(|i| args.intersector.contains(i)).collect();
    ask(args, &asked, &mut subjects, &mut report)?;
    if let Some(file) = &args.test.json {
        output::write_json(file, &report)?;
    }
    talk::print(&report.text(&asked))?;
    match report.failures() {
        0 => Ok(()),
        1 => Err(Stop::failed("1 cell is out of its bound")),
        n => Err(Stop::failed(format!("{n} cells are out of their bounds"))),
    }
}

/// Measures the baseline of the one backend.
fn record_rates(args: &StabilityArgs, subjects: &mut [Subject], file: &Path) -> Result<(), Stop> {
    let [subject] = subjects else {
        let names: Vec<_> = subjects.iter().map(|s| s.device().backend).collect();
        let there = format!("there are {}; name one with --backend", names.join(", "));
        return Err(Stop::bad(format!(
            "--record measures one backend, but {there}"
        )));
    };
    let mut progress = Progress::new(Family::ALL.len() as u64, args.test.quiet);
    let (name, extent) = (subject.device().backend, (args.seeds, args.rays));
    let found = baseline::record(subject.as_mut(), extent, &mut |family| {
        progress.step(&format!("{name} {family}"));
    })?;
    output::write_json(file, &found)?;
    let rates = found.entries.len();
    talk::print(&format!("{rates} rates of {}\n", found.ground))
}

/// Leaves out what a backend does not support.
fn ask(
    args: &StabilityArgs,
    asked: &[Intersector],
    subjects: &mut [Subject],
    report: &mut Report,
) -> Result<(), Stop> {
    let (seed, rays) = (args.seed, args.rays);
    let plan = Plan { seed, rays };
    let mut progress = Progress::new((Family::ALL.len() * subjects.len()) as u64, args.test.quiet);
    for family in Family::ALL {
        let test = StressTest::new(family, &plan);
        for subject in &mut *subjects {
            let backend = subject.device().backend;
            for &by in asked {
                let begun = Instant::now();
                let cell = test.ask(subject.as_mut(), by)?;
                report.rows.extend(cell.map(|cell| Row {
                    backend,
                    cell,
                    seconds: begun.elapsed().as_secs_f64(),
                }));
            }
            progress.step(&format!("{backend} {family}"));
        }
    }
    Ok(())
}

#[derive(Default, Serialize)]
struct Report {
    #[serde(flatten)]
    tested: Tested,
    seed: u64,
    /// Number of rays of each family.
    rays: u32,
    rows: Vec<Row>,
}

/// Result of one family with one intersector on one backend.
struct Row {
    backend: &'static str,
    cell: Cell,
    seconds: f64,
}

impl Serialize for Row {
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
            // For closed meshes only: rays from inside without a hit; rays that cross the surface too often or too
            // seldom.
            "leaks": of(Measure::Leaks),
            "double_hits": of(Measure::DoubleHits),
            // Whether every count is within its bound.
            "ok": cell.is_ok(),
            "seconds": self.seconds,
        });
        row.serialize(serializer)
    }
}

fn count(m: &Measured) -> Value {
    json!({ "rays": m.of, "count": m.count, "rate": m.rate(), "bound": m.bound, "ok": m.is_ok() })
}

impl Report {
    /// Returns the number of cells with a count outside its bound.
    fn failures(&self) -> usize {
        self.rows.iter().filter(|r| !r.cell.is_ok()).count()
    }

    fn text(&self, asked: &[Intersector]) -> String {
        let mut text = self.tested.text.clone();
        for backend in &self.tested.names {
            text += &self.tables(backend, asked);
        }
        for row in self.rows.iter().filter(|r| !r.cell.is_ok()) {
            text += &self.complaint(row);
        }
        text
    }

    /// Formats families as rows and intersectors as columns: first wrong answers, then leaks and double hits.
    fn tables(&self, backend: &str, asked: &[Intersector]) -> String {
        let mut text = format!("\n{backend}, rays of each family: {}\n", self.rays);
        text += &self.table(backend, "wrong", asked, &|r| share(r.cell.wrong()));
        text + &self.table(backend, "leaks, double hits", asked, &|r| {
            let all = [Measure::Leaks, Measure::DoubleHits].map(|m| r.cell.get(m).map(share));
            all.into_iter().flatten().collect::<Vec<_>>().join(", ")
        })
    }

    /// Formats the families for which `cell` returns text.
    fn table(
        &self,
        backend: &str,
        what: &str,
        asked: &[Intersector],
        cell: &dyn Fn(&Row) -> String,
    ) -> String {
        let row = |family: Family| {
            let of = |by: &Intersector| {
                let this = (backend, family, *by);
                let is_this = |r: &&Row| (r.backend, r.cell.family, r.cell.intersector) == this;
                let found = self.rows.iter().find(is_this);
                (by.name(), found.map_or("-".to_owned(), cell))
            };
            let cells: Vec<_> = asked.iter().map(of).collect();
            let says = cells.iter().any(|(_, c)| !c.is_empty() && c != "-");
            says.then(|| [vec![(what, family.name().to_owned())], cells].concat())
        };
        let rows: Vec<_> = Family::ALL.into_iter().filter_map(row).collect();
        match rows.is_empty() {
            true => String::new(),
            false => table(rows, 1),
        }
    }

    /// Returns the counts outside their bounds, and the command that reproduces them.
    fn complaint(&self, row: &Row) -> String {
        let (backend, by) = (row.backend, row.cell.intersector);
        let out = row.cell.measured.iter().filter(|m| !m.is_ok());
        let out = out.map(|m| {
            let expected = match m.bound {
                Some([_, 0.0]) => "none".to_owned(),
                Some([low, high]) => format!("{} to {}", percent(low), percent(high)),
                None => "nobody knows what; abvh stability --record measures it".to_owned(),
            };
            let [count, of] = [m.count, m.of].map(|n| grouped(n as usize));
            let (what, rate) = (m.measure.name().replace('_', " "), percent(m.rate()));
            format!("{what} {count} of {of} ({rate}), expected {expected}")
        });
        let out = out.collect::<Vec<_>>().join("; ");
        let (family, seed, rays) = (row.cell.family, self.seed, self.rays);
        format!(
            "{backend} {by} {family}: {out}\n    abvh stability --backend {backend} --intersector {by} --seed {seed} --rays {rays}\n"
        )
    }
}

/// Formats a rate with its count, marked if it is outside its bound.
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

    fn report(wrong: u64, leaks: u64, by: Intersector) -> Report {
        let counts = [
            (Measure::Wrong, wrong, 2000),
            (Measure::Leaks, leaks, 1000),
            (Measure::DoubleHits, 0, 2000),
        ];
        let cell = Cell::new(Family::Edges, by, &counts, Arithmetic::IEEE);
        Report {
            seed: 9,
            rays: 2000,
            rows: vec![Row {
                backend: "x",
                cell,
                seconds: 0.5,
            }],
            ..Report::default()
        }
    }

    #[test]
    fn what_never_may_be_is_a_failure_with_the_command_that_shows_it() {
        let sound = report(0, 0, Intersector::Exact);
        assert!(sound.failures() == 0 && sound.text(&Intersector::ALL).is_empty());
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
