//! Alternating measurement of contenders, so that changes of the machine's load affect all.

use rustix::time::{ClockId, Timespec, clock_gettime};
use std::time::Instant;

/// A function to measure.
pub struct Contender<'a> {
    /// Name for the report.
    pub name: String,
    /// Number of threads.
    pub threads: usize,
    run: Box<dyn FnMut() -> u64 + 'a>,
}

impl<'a> Contender<'a> {
    /// Creates a contender that runs on `threads` threads. `run` returns the number of hits, or 0 if it traces no rays.
    pub fn new(name: &str, threads: usize, run: impl FnMut() -> u64 + 'a) -> Self {
        let (name, run) = (name.to_owned(), Box::new(run));
        Self { name, threads, run }
    }
}

/// Measured times of one contender, in milliseconds, one per round.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Name of the contender.
    pub name: String,
    /// Number of threads.
    pub threads: usize,
    /// Wall time.
    pub wall: Vec<f64>,
    /// Processor time of all threads of this program.
    pub processor: Vec<f64>,
    /// Number of hits in the last run.
    pub hits: u64,
}

/// Runs each contender once without measuring, and then `rounds` times in alternation.
pub fn in_turn(mut contenders: Vec<Contender<'_>>, rounds: usize) -> Vec<Samples> {
    let blank = |contender: &Contender<'_>| Samples {
        name: contender.name.clone(),
        threads: contender.threads,
        ..Samples::default()
    };
    let mut samples: Vec<Samples> = contenders.iter().map(blank).collect();
    for contender in &mut contenders {
        (contender.run)();
    }
    for round in 0..rounds {
        // The order rotates, so that the first contender changes each round.
        for step in 0..contenders.len() {
            let at = (round + step) % contenders.len();
            measure(&mut contenders[at], &mut samples[at]);
        }
    }
    samples
}

fn measure(contender: &mut Contender<'_>, samples: &mut Samples) {
    let (began, used) = (Instant::now(), processor_ms());
    samples.hits = (contender.run)();
    samples.processor.push(processor_ms() - used);
    samples.wall.push(began.elapsed().as_secs_f64() * 1e3);
}

/// Returns the processor time used by all threads of this program, in milliseconds.
fn processor_ms() -> f64 {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(ClockId::ProcessCPUTime);
    tv_sec as f64 * 1e3 + tv_nsec as f64 * 1e-6
}

impl Samples {
    /// Returns the median ratio of times to those of `other` in the same round, by wall time and by processor time.
    ///
    /// A ratio below 1 means that `self` is faster.
    pub fn over(&self, other: &Self) -> [f64; 2] {
        let [wall, processor] = [&self.wall, &self.processor];
        [(wall, &other.wall), (processor, &other.processor)].map(|(ours, theirs)| {
            let each = ours.iter().zip(theirs).map(|(a, b)| a / b);
            median(&each.collect::<Vec<f64>>())
        })
    }
}

/// Returns the median, or NaN if there are no values.
pub fn median(of: &[f64]) -> f64 {
    let mut sorted = of.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |place: usize| sorted.get(place).copied().unwrap_or(f64::NAN);
    let n = sorted.len();
    f64::midpoint(at(n / 2), at(n.saturating_sub(1) / 2))
}

/// Returns the minimum, or NaN if there are no values.
pub fn least(of: &[f64]) -> f64 {
    of.iter().copied().fold(f64::NAN, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contenders_run_once_per_round() {
        let (mut a, mut b) = (0, 0);
        let count = |n: &mut u64| {
            *n += 1;
            *n
        };
        let contenders = vec![
            Contender::new("a", 1, || count(&mut a)),
            Contender::new("b", 2, || count(&mut b)),
        ];
        let samples = in_turn(contenders, 5);
        assert_eq!([samples[0].hits, samples[1].hits], [6, 6]);
        assert_eq!([samples[0].wall.len(), samples[1].processor.len()], [5, 5]);
        assert_eq!([a, b], [6, 6]);
    }

    #[test]
    fn ratios_are_computed_per_round() {
        let of = |wall: &[f64]| Samples {
            wall: wall.to_vec(),
            ..Samples::default()
        };
        // The load of the second round affects both.
        let (ours, theirs) = (of(&[1.0, 10.0, 3.0]), of(&[2.0, 20.0, 4.0]));
        assert_eq!(ours.over(&theirs)[0], 0.5);
        assert!(ours.over(&theirs)[1].is_nan());
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(least(&[4.0, 1.0, 2.0]), 1.0);
    }
}
