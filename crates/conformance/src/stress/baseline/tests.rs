//! Whose bounds hold where.

use super::*;

const LOOSE: Arithmetic = Arithmetic {
    rounds_division: false,
    fuses: false,
};

/// A cell of rays at edges of closed bodies, of which so many answers are wrong, leak or hit twice.
fn edges(by: Intersector, [wrong, leaks, doubles]: [u64; 3], device: Arithmetic) -> Cell {
    let counts = [
        (Measure::Wrong, wrong, 8192),
        (Measure::Leaks, leaks, 4096),
        (Measure::DoubleHits, doubles, 8192),
    ];
    Cell::new(Family::Edges, by, &counts, device)
}

#[test]
fn a_device_is_held_to_what_was_measured_with_its_own_arithmetic() {
    let by = Intersector::MollerTrumbore;
    let [of_host, of_gpu] = [[1983, 186, 3828], [2056, 412, 2990]];
    assert!(edges(by, of_host, Arithmetic::IEEE).is_ok());
    assert!(edges(by, of_gpu, LOOSE).is_ok());
    assert!(!edges(by, of_gpu, Arithmetic::IEEE).is_ok());
    assert!(!edges(by, of_host, LOOSE).is_ok());
}

#[test]
fn answers_that_are_equal_everywhere_have_one_bound_and_unknown_arithmetic_has_none_of_its_own() {
    let strange = Arithmetic {
        rounds_division: false,
        fuses: true,
    };
    for device in [Arithmetic::IEEE, LOOSE, strange] {
        let of = |by| known(Family::Edges, by, Measure::Wrong, device);
        let by = Intersector::Watertight;
        let everywhere = known(Family::Edges, by, Measure::Wrong, Arithmetic::IEEE);
        assert_eq!(of(Intersector::Watertight), everywhere);
        assert_eq!(of(Intersector::Woop).is_some(), device != strange);
        assert!(edges(Intersector::Exact, [0; 3], device).is_ok());
        assert!(!edges(Intersector::Exact, [1, 0, 0], device).is_ok());
    }
}

#[test]
fn every_baseline_has_every_cell_once_and_says_where_it_comes_from() {
    for baseline in BASELINES.iter() {
        let of = |by: Intersector| decisive(by, baseline.arithmetic) == baseline.arithmetic;
        let all = Intersector::ALL.into_iter().filter(|&by| of(by));
        for (family, by) in all.flat_map(|by| Family::ALL.map(|f| (f, by))) {
            let this = |e: &&RateEntry| e.family == family.name() && e.intersector == by.name();
            let mut found: Vec<_> = baseline.entries.iter().filter(this).collect();
            found.retain(|e| e.measure == Measure::Wrong.name());
            let none = by == Intersector::Exact;
            assert_eq!(found.len(), usize::from(!none), "{family} {by}");
        }
        assert!(baseline.ground.contains("seed"), "{}", baseline.ground);
    }
}
