//! Measures `src/baseline.json` anew: `cargo run --release -p stability --example baseline > crates/stability/src/baseline.json`.

use backend::Intersector;
use cpu_ref::CpuBackend;
use stability::baseline::{Entry, is_never};
use stability::{Cell, Exam, Family, Measured, Plan};
use std::error::Error;
use std::io::Write;

/// Seeds from 1, the usual one.
const SEEDS: u64 = 32;

fn main() -> Result<(), Box<dyn Error>> {
    let mut cpu = CpuBackend::new(None)?;
    let mut entries = Vec::new();
    for family in Family::ALL {
        let mut cells: Vec<Vec<Cell>> = vec![Vec::new(); Intersector::ALL.len()];
        for seed in 1..=SEEDS {
            let exam = Exam::new(
                family,
                &Plan {
                    seed,
                    ..Plan::default()
                },
            );
            for (by, cells) in Intersector::ALL.into_iter().zip(&mut cells) {
                if by == Intersector::Exact {
                    continue;
                }
                let tally = exam.ask(&mut cpu, by)?.ok_or("the host knows them all")?;
                cells.push(Cell::new(family, by, &tally));
            }
        }
        entries.extend(cells.iter().flat_map(|c| of_cells(c)));
    }
    let mut out = std::io::stdout().lock();
    let lines: Result<Vec<_>, _> = entries.iter().map(serde_json::to_string).collect();
    writeln!(out, "[\n{}\n]", lines?.join(",\n"))?;
    Ok(())
}

/// One entry for each thing counted in the same cell of all seeds.
fn of_cells(cells: &[Cell]) -> Vec<Entry> {
    let Some(first) = cells.first() else {
        return Vec::new();
    };
    let free = |m: &&Measured| !is_never(first.intersector, m.measure);
    let numbered = first.measured.iter().filter(free).enumerate();
    let entries = numbered.map(|(i, m)| {
        let all: Vec<&Measured> = cells.iter().map(|c| &c.measured[i]).collect();
        let (count, of) = (
            all.iter().map(|m| m.count).sum(),
            all.iter().map(|m| m.of).sum(),
        );
        Entry {
            family: first.family.name().to_owned(),
            intersector: first.intersector.name().to_owned(),
            measure: m.measure.name().to_owned(),
            count,
            of,
            spread: spread(&all, count as f64 / of as f64),
        }
    });
    entries.collect()
}

/// Variance of the rate among seeds over that of independent rays, at least 1.
fn spread(all: &[&Measured], mean: f64) -> f64 {
    let squares: f64 = all.iter().map(|m| (m.rate() - mean).powi(2)).sum();
    let independent = mean * (1.0 - mean) / all[0].of as f64;
    if independent == 0.0 {
        return 1.0;
    }
    let spread = squares / (all.len() - 1) as f64 / independent;
    (spread.max(1.0) * 100.0).ceil() / 100.0
}
