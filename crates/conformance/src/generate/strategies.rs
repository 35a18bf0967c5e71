//! Building blocks of the strategies, and their random numbers.
//!
//! `proptest` shrinks one number at a time. A failing scene has thousands of numbers, and each attempt runs
//! a property on a backend. So these strategies shrink in large steps: [`shrinking_list`] removes half of a list at
//! once, and [`last_of`] tries the simplest of a few values first.

use geom::Point;
use proptest::prelude::*;
use proptest::strategy::{NewTree, ValueTree};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::fmt::Debug;

/// Milliseconds after which shrinking stops. The smallest failing case found by then is reported.
const MAX_SHRINK_TIME: u32 = 30_000;

/// Bytes of the seed of proptest's generator.
const SEED: usize = 32;

/// Returns the generator's seed for case `number` of `seed`, big-endian, so that both can be read in hexadecimal.
pub fn seed_bytes(seed: u64, number: u32) -> [u8; SEED] {
    let mut bytes = [0; SEED];
    bytes[..8].copy_from_slice(&seed.to_be_bytes());
    bytes[8..12].copy_from_slice(&number.to_be_bytes());
    bytes
}

/// Returns a runner whose random numbers depend on `seed` and `number` alone.
pub(crate) fn runner(seed: u64, number: u32, max_shrink_iters: u32) -> TestRunner {
    let config = Config {
        max_shrink_iters,
        max_shrink_time: MAX_SHRINK_TIME,
        failure_persistence: None,
        ..Config::default()
    };
    let bytes = seed_bytes(seed, number);
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
}

/// Returns one value of a strategy, which depends on `seed` alone.
pub(crate) fn sample<S: Strategy>(strategy: &S, seed: u64) -> S::Value {
    value_tree(strategy, &mut runner(seed, 0, 0)).current()
}

/// Returns a `proptest` value tree: a value that can shrink.
pub(crate) fn value_tree<S: Strategy>(strategy: &S, runner: &mut TestRunner) -> S::Tree {
    strategy
        .new_tree(runner)
        .expect("no strategy here rejects values")
}

/// Returns a strategy for lists with one value of each strategy in `elements`.
///
/// Shrinking removes runs of elements, from halves of the list down to single elements. Then it shrinks those that are
/// left. At least one element remains.
pub(crate) fn shrinking_list<S: Strategy>(
    elements: impl IntoIterator<Item = S>,
) -> ShrinkingList<S> {
    ShrinkingList(elements.into_iter().collect())
}

/// The strategy that [`shrinking_list`] returns.
#[derive(Clone, Debug)]
pub(crate) struct ShrinkingList<S>(Vec<S>);

impl<S: Strategy> Strategy for ShrinkingList<S> {
    type Tree = ShrinkingListTree<S::Tree>;
    type Value = Vec<S::Value>;

    fn new_tree(&self, runner: &mut TestRunner) -> NewTree<Self> {
        let elements = self.0.iter().map(|element| element.new_tree(runner));
        let elements = elements.collect::<Result<Vec<_>, _>>()?;
        Ok(ShrinkingListTree {
            kept: (0..elements.len()).collect(),
            run: elements.len().div_ceil(2),
            elements,
            begin: 0,
            removed: Vec::new(),
            next: 0,
        })
    }
}

/// A list whose runs of elements are removed, then its elements shrunk.
#[derive(Debug)]
pub(crate) struct ShrinkingListTree<T> {
    elements: Vec<T>,
    /// Indices of the elements that are left.
    kept: Vec<usize>,
    /// Number of elements to remove at once; 0 once elements are shrunk.
    run: usize,
    /// Where the next run begins, as an index into `kept`.
    begin: usize,
    /// The run that was removed last, or empty if the resulting list is known to fail.
    removed: Vec<usize>,
    /// The element to shrink, as an index into `kept`.
    next: usize,
}

impl<T: ValueTree> ShrinkingListTree<T> {
    /// Removes the next run. Returns `false` if no run is left to try.
    fn remove(&mut self) -> bool {
        while self.run > 0 {
            let most = self.run.min(self.kept.len().saturating_sub(1));
            let end = self.kept.len().min(self.begin + most);
            if self.begin < end {
                self.removed = self.kept.drain(self.begin..end).collect();
                return true;
            }
            self.begin = 0;
            self.run /= 2;
        }
        false
    }
}

impl<T: ValueTree> ValueTree for ShrinkingListTree<T> {
    type Value = Vec<T::Value>;

    fn current(&self) -> Self::Value {
        self.kept
            .iter()
            .map(|&i| self.elements[i].current())
            .collect()
    }

    fn simplify(&mut self) -> bool {
        self.removed.clear();
        if self.remove() {
            return true;
        }
        while let Some(&element) = self.kept.get(self.next) {
            if self.elements[element].simplify() {
                return true;
            }
            self.next += 1;
        }
        false
    }

    fn complicate(&mut self) -> bool {
        if self.removed.is_empty() {
            let element = self.kept.get(self.next);
            return element.is_some_and(|&element| self.elements[element].complicate());
        }
        let run = self.removed.drain(..);
        let begin = self.begin;
        self.begin += run.len();
        self.kept.splice(begin..begin, run);
        // The restored list is known to fail. So it is not tested again: the next run, if any, is removed first.
        self.remove();
        true
    }
}

/// Returns a strategy for the last of `values`. Shrinking finds the first value that fails.
pub(crate) fn last_of<T: Clone + Debug>(values: impl Into<Vec<T>>) -> LastOf<T> {
    LastOf(values.into())
}

/// The strategy that [`last_of`] returns.
#[derive(Clone, Debug)]
pub(crate) struct LastOf<T>(Vec<T>);

impl<T: Clone + Debug> Strategy for LastOf<T> {
    type Tree = LastOfTree<T>;
    type Value = T;

    fn new_tree(&self, _: &mut TestRunner) -> NewTree<Self> {
        let last = self.0.len() - 1;
        Ok(LastOfTree {
            values: self.0.clone(),
            low: 0,
            now: last,
            high: last,
        })
    }
}

/// A value that shrinks to a simpler one.
#[derive(Debug)]
pub(crate) struct LastOfTree<T> {
    values: Vec<T>,
    /// The first value that was not tried.
    low: usize,
    now: usize,
    /// The simplest value that is known to fail.
    high: usize,
}

impl<T: Clone + Debug> ValueTree for LastOfTree<T> {
    type Value = T;

    fn current(&self) -> T {
        self.values[self.now].clone()
    }

    fn simplify(&mut self) -> bool {
        let is_left = self.low < self.now;
        self.high = self.now;
        self.now = self.low;
        is_left
    }

    fn complicate(&mut self) -> bool {
        let is_left = self.now < self.high;
        self.now += usize::from(is_left);
        self.low = self.now;
        is_left
    }
}

/// Precision of generated numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Precision {
    /// As a multiple of an eighth, if below 1024 in magnitude. Other numbers stay as they are.
    Eighths,
    /// With three significant bits.
    ThreeBits,
    /// With all bits.
    Full,
}

/// Returns a strategy for full precision, which shrinks to less.
pub(crate) fn precision() -> LastOf<Precision> {
    last_of([Precision::Eighths, Precision::ThreeBits, Precision::Full])
}

impl Precision {
    /// Rounds a number. Numbers that are not finite stay as they are.
    pub(crate) fn number(self, x: f32) -> f32 {
        match self {
            Self::Eighths if x.abs() < 1024.0 => (8.0 * x).round() / 8.0,
            Self::ThreeBits if x.is_finite() => f32::from_bits(x.to_bits() & !0x1f_ffff),
            _ => x,
        }
    }

    pub(crate) fn point(self, p: Point) -> Point {
        p.map(|x| self.number(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the smallest value of a strategy that `fails`, and the number of attempts.
    fn shrunk<S: Strategy>(strategy: &S, fails: impl Fn(&S::Value) -> bool) -> (S::Value, u32) {
        let mut tree = value_tree(strategy, &mut runner(1, 1, 0));
        let (mut attempts, mut goes_on) = (0, tree.simplify());
        while goes_on {
            attempts += 1;
            goes_on = if fails(&tree.current()) {
                tree.simplify()
            } else {
                tree.complicate()
            };
        }
        (tree.current(), attempts)
    }

    #[test]
    fn lists_shrink_in_few_attempts() {
        let numbers = shrinking_list((0..1000).map(Just));
        for wanted in [vec![7], vec![0, 999], vec![3, 400, 401, 800]] {
            let (list, attempts) = shrunk(&numbers, |l| wanted.iter().all(|x| l.contains(x)));
            assert_eq!(list, wanted);
            assert!(attempts < 200, "{attempts}");
        }
        assert_eq!(shrunk(&numbers, |_| true).0.len(), 1);
        assert_eq!(shrunk(&numbers, |l| l.len() > 999).0.len(), 1000);
    }

    #[test]
    fn remaining_elements_shrink() {
        let lists = shrinking_list((0..9).map(|i| (Just(i), 0..100)));
        let fails = |l: &Vec<(i32, i32)>| l.iter().any(|&(i, x)| i == 5 && x >= 0);
        assert_eq!(shrunk(&lists, fails).0, [(5, 0)]);
    }

    #[test]
    fn shrinking_finds_the_simplest_failure() {
        for least in 0..4 {
            let found = shrunk(&last_of([0, 1, 2, 3]), |&x| x >= least);
            assert_eq!(found.0, least);
        }
    }

    #[test]
    fn precision_preserves_special_numbers() {
        for precision in [Precision::Eighths, Precision::ThreeBits, Precision::Full] {
            assert!(precision.number(f32::NAN).is_nan());
            assert_eq!(precision.number(f32::NEG_INFINITY), f32::NEG_INFINITY);
            assert_eq!(precision.number(-0.0).to_bits(), (-0.0_f32).to_bits());
            assert_eq!(precision.number(0.25), 0.25);
        }
    }
}
