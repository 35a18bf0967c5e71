//! The host's answers against their bounds, and a host that is not what it says.

use backend::{Arithmetic, Intersector};
use conformance::stress::{Cell, Family, Plan, StressTest};
use cpu_ref::CpuBackend;

/// Every family, with its exact answers.
fn stress_tests(plan: &Plan) -> Vec<StressTest> {
    let all = Family::ALL.into_iter();
    all.map(|family| StressTest::new(family, plan)).collect()
}

/// Traces by `asked` but judges as if it were `named`.
fn cells(tests: &[StressTest], asked: Intersector, named: Intersector) -> Vec<Cell> {
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let cell = |test: &StressTest| {
        let cell = test.ask(&mut cpu, asked).unwrap().unwrap();
        let counts = cell.measured.iter().map(|m| (m.measure, m.count, m.of));
        let counts: Vec<_> = counts.collect();
        Cell::new(test.family(), named, &counts, Arithmetic::IEEE)
    };
    tests.iter().map(cell).collect()
}

fn red(cells: &[Cell]) -> Vec<String> {
    let bad = cells.iter().filter(|c| !c.is_ok());
    bad.map(|c| format!("{} {}: {:?}", c.intersector, c.family, c.measured))
        .collect()
}

#[test]
fn every_rate_of_the_host_is_within_its_bound_whatever_the_seed_and_number_of_rays() {
    let mut all = Vec::new();
    let many = match std::env::var("ABVH_FULL") {
        Ok(full) if full == "1" => 8192,
        _ => 1024,
    };
    for (seed, rays) in [(1, many), (77, 500), (78, 33)] {
        let tests = stress_tests(&Plan { seed, rays });
        for by in Intersector::ALL {
            all.extend(cells(&tests, by, by));
        }
    }
    let measured = all.iter().flat_map(|c| &c.measured);
    assert!(measured.clone().all(|m| m.of > 0 && m.bound.is_some()));
    assert_eq!(red(&all), [""; 0]);
}

#[test]
fn whoever_answers_by_another_intersector_is_found_out_whether_worse_or_better() {
    use Intersector::{Exact, MollerTrumbore, Watertight, Woop};
    let tests = stress_tests(&Plan {
        seed: 5,
        rays: 2048,
    });
    for (asked, named) in [
        (Woop, Exact),
        (Watertight, Exact),
        (MollerTrumbore, Watertight),
        (Exact, Woop),
        (Watertight, MollerTrumbore),
    ] {
        let red = red(&cells(&tests, asked, named));
        assert!(red.len() >= 5, "{asked} for {named}: {red:#?}");
    }
}
