//! Contenders in turn: so that a change of the machine's load falls on all of them.

use rustix::time::{ClockId, Timespec, clock_gettime};
use std::time::Instant;

/// Something to measure.
pub struct Contender<'a> {
    /// Who does it.
    pub name: String,
    /// On how many threads.
    pub threads: usize,
    run: Box<dyn FnMut() -> u64 + 'a>,
}

impl<'a> Contender<'a> {
    /// Measures `run` on `threads`. It returns the number of hits, where rays are traced.
    pub fn new(name: &str, threads: usize, run: impl FnMut() -> u64 + 'a) -> Self {
        let (name, run) = (name.to_owned(), Box::new(run));
        Self { name, threads, run }
    }
}

/// What was measured of one contender, a number a round, in milliseconds.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Who did it.
    pub name: String,
    /// On how many threads.
    pub threads: usize,
    /// Time passed.
    pub wall: Vec<f64>,
    /// Processor time of all threads of this program.
    pub processor: Vec<f64>,
    /// Hits of the last run.
    pub hits: u64,
}

/// Runs all contenders once, and then `rounds` times one after the other while measuring.
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
        // Nobody always comes after the same one.
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

/// Processor time that all threads of this program have used.
fn processor_ms() -> f64 {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(ClockId::ProcessCPUTime);
    tv_sec as f64 * 1e3 + tv_nsec as f64 * 1e-6
}

impl Samples {
    /// Median over all rounds of a time over another contender's in the same round, by time passed and by
    /// processor time; below 1 is faster.
    pub fn over(&self, other: &Self) -> [f64; 2] {
        let [wall, processor] = [&self.wall, &self.processor];
        [(wall, &other.wall), (processor, &other.processor)].map(|(ours, theirs)| {
            let each = ours.iter().zip(theirs).map(|(a, b)| a / b);
            median(&each.collect::<Vec<f64>>())
        })
    }
}

/// The middle one; not a number if there is none.
pub fn median(of: &[f64]) -> f64 {
    let mut sorted = of.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |place: usize| sorted.get(place).copied().unwrap_or(f64::NAN);
    let n = sorted.len();
    f64::midpoint(at(n / 2), at(n.saturating_sub(1) / 2))
}

/// The least one; not a number if there is none.
pub fn least(of: &[f64]) -> f64 {
    of.iter().copied().fold(f64::NAN, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_contender_runs_once_a_round_and_once_before() {
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
    fn ratios_are_taken_round_by_round() {
        let of = |wall: &[f64]| Samples {
            wall: wall.to_vec(),
            ..Samples::default()
        };
        // The load of the second round falls on both.
        let (ours, theirs) = (of(&[1.0, 10.0, 3.0]), of(&[2.0, 20.0, 4.0]));
        assert_eq!(ours.over(&theirs)[0], 0.5);
        assert!(ours.over(&theirs)[1].is_nan());
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(least(&[4.0, 1.0, 2.0]), 1.0);
    }
}
