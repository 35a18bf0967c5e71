//! How long a frame takes under each update policy, on the host's clock: frames of the run itself.
//!
//! What is estimated is the mean frame of the whole run but the first, which waits for the first tree under every
//! policy and is start-up, like reading the scene. The tree of `t-sah` takes many times as long as another, and so
//! does its start-up; it is tried only if it can be built in what is left of the trial's time, so that who takes it
//! waits no longer than that.

use super::facts::Facts;
use super::plan::{Guess, Plan};
use super::stand::TrialBackend;
use super::{Run, noise};
use crate::choose;
use crate::stop::Stop;
use crate::timing::FOR_ALL;
use crate::warm_up;
use backend::Method;
use pipeline::{Driver, Frame, PipelineError, Update};
use std::time::Instant;

/// A policy, the method it goes with, and the milliseconds of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timed {
    pub(super) update: Update,
    pub(super) method: Method,
    pub(super) ms: f64,
    /// Those of its first frame, which builds the first tree.
    pub(super) first_ms: f64,
    /// Whether that is but the least it can be: it was given up.
    pub(super) at_least: bool,
}

/// What came of a trial.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    pub(super) timed: Vec<Timed>,
    /// Who was not tried, and why.
    pub(super) left_out: Vec<String>,
    /// Frames that stand behind a time.
    pub(super) frames: usize,
}

/// A run to try policies over.
pub(super) struct Trial<'a> {
    run: &'a Run<'a>,
    facts: &'a Facts,
    guess: Guess,
    begun: Instant,
    allowance_ms: f64,
    /// Where a frame's time depends on its moment alone.
    spread: Plan,
    /// Where it depends on what came before.
    stretches: Plan,
}

/// A policy that must be so many times slower than another is given up.
const HOPELESS: f64 = 1.5;
/// The first tree, refitted, may cost so many times a fresh one before nobody tries it.
const DECAYED: f64 = 8.0;
/// A first build takes so many times as long as one in the middle of a run, at most.
const COLD: f64 = 3.0;
/// Share of the trial's time that is for frames, and of that, for those of one policy.
const SHARES: [f64; 2] = [0.5, 0.25];

impl<'a> Trial<'a> {
    /// A trial of so many policies in so many milliseconds; `None` if there is no time for it.
    pub(super) fn within(
        allowance_ms: f64,
        policies: usize,
        guess: Guess,
        (run, facts): (&'a Run<'a>, &'a Facts),
    ) -> Option<Self> {
        let [all, one] = SHARES.map(|share| share * allowance_ms);
        Some(Self {
            run,
            facts,
            guess,
            begun: Instant::now(),
            allowance_ms,
            spread: Plan::spread(all, policies, guess)?,
            // Frames may well be slower than guessed.
            stretches: Plan::stretches(0.5 * one, guess),
        })
    }

    /// Milliseconds since it began.
    pub(super) fn elapsed_ms(&self) -> f64 {
        self.begun.elapsed().as_secs_f64() * 1e3
    }

    /// Times `candidates`; those that the backend refuses are left out, and so are those that cannot win.
    ///
    /// # Errors
    /// Nothing could be timed.
    pub(super) fn time(
        &self,
        stand: &mut TrialBackend<'_>,
        mut candidates: Vec<(Update, Method)>,
    ) -> Result<Outcome, Stop> {
        candidates.sort_by_key(|&(update, _)| turn(update));
        let mut outcome = Outcome {
            frames: self.spread.timed(),
            ..Outcome::default()
        };
        let mut refused = None;
        for (update, method) in candidates {
            let best = outcome.best();
            if let Some(why) = self.hopeless(update, best) {
                outcome.leave_out(update, &why);
                continue;
            }
            match self.policy(stand, (update, method), best) {
                Ok(timed) => outcome.timed.push(timed),
                Err(stop) => refused = Some(stop),
            }
        }
        match refused {
            Some(stop) if outcome.timed.is_empty() => Err(stop),
            _ => Ok(outcome),
        }
    }

    /// Why a policy need not be tried.
    fn hopeless(&self, update: Update, best: f64) -> Option<String> {
        let left_ms = self.allowance_ms - self.elapsed_ms();
        let build_ms = self.guess.build_ms;
        match update {
            _ if left_ms < 0.0 => Some("the time for trying out was up".to_owned()),
            Update::Rebuild if build_ms / COLD > HOPELESS * best => Some(format!(
                "each frame would wait for a build ({build_ms:.0} ms the first)"
            )),
            Update::Refit if self.facts.usual_decay() > DECAYED => Some(format!(
                "its tree would mostly cost {:.0} times a fresh one",
                self.facts.usual_decay()
            )),
            Update::TSah if FOR_ALL * build_ms > left_ms => Some(format!(
                "its tree would take about {:.1} s to build",
                FOR_ALL * build_ms * 1e-3
            )),
            _ => None,
        }
    }

    fn policy(
        &self,
        stand: &mut TrialBackend<'_>,
        (update, method): (Update, Method),
        best: f64,
    ) -> Result<Timed, Stop> {
        let plan = match update {
            Update::Async(_) => &self.stretches,
            _ => &self.spread,
        };
        let idle = Instant::now();
        let mut driver = stand.driver(method, update)?;
        // The first tree is that of the run's first frame.
        let first = walls(&mut driver, self.run, &self.run.frames[..1], f64::INFINITY)?;
        warm_up::after_idling(&mut driver, self.run.query, idle.elapsed())?;
        let (ms, at_least) = mean(&mut driver, self.run, plan, best)?;
        stand.put_back(driver);
        Ok(Timed {
            update,
            method,
            ms,
            first_ms: first.map_or(0.0, |walls| walls.iter().sum()),
            at_least,
        })
    }
}

impl Outcome {
    /// Says so once, whatever the layout.
    fn leave_out(&mut self, update: Update, why: &str) {
        let told = format!("{} left out, {why}", choose::update_name(update));
        if !self.left_out.contains(&told) {
            self.left_out.push(told);
        }
    }

    /// Milliseconds of the fastest so far.
    fn best(&self) -> f64 {
        self.timed
            .iter()
            .map(|t| t.ms)
            .fold(f64::INFINITY, f64::min)
    }

    /// The fastest; `usual` if that is as fast but for noise.
    pub(super) fn fastest(&self, usual: (Update, Method)) -> Option<Timed> {
        let whole = || self.timed.iter().filter(|t| !t.at_least);
        let best = whole().min_by(|a, b| a.ms.total_cmp(&b.ms))?;
        let usual = whole().find(|t| (t.update, t.method) == usual);
        let usual = usual.filter(|t| t.ms <= noise(self.frames) * best.ms);
        Some(*usual.unwrap_or(best))
    }
}

/// Those first that win most often, for time may run out.
fn turn(update: Update) -> usize {
    match update {
        Update::Async(_) => 0,
        Update::Refit => 1,
        Update::TSah => 2,
        Update::DeviceRebuild => 3,
        Update::Rebuild => 4,
    }
}

/// The mean of the medians at all places, or the least it can be once that is hopeless beside `best`.
fn mean(driver: &mut Driver, run: &Run<'_>, plan: &Plan, best: f64) -> Result<(f64, bool), Stop> {
    let parts = plan.medians() as f64;
    // Were every other part for nothing, this would be too much.
    let limit = HOPELESS * best * parts;
    let mut medians: Vec<f64> = Vec::new();
    for place in &plan.places {
        let Some(walls) = walls(driver, run, &run.frames[place.clone()], limit)? else {
            return Ok((limit / parts, true));
        };
        medians.extend(plan.sum_up(&walls));
        let least = medians.iter().sum::<f64>() / parts;
        if least > HOPELESS * best {
            return Ok((least, true));
        }
    }
    Ok((medians.iter().sum::<f64>() / parts, false))
}

/// Why frames end early.
enum Halt {
    Stop(Stop),
    Hopeless,
}

impl From<PipelineError> for Halt {
    fn from(e: PipelineError) -> Self {
        Self::Stop(e.into())
    }
}

/// What each frame took on the host's clock; `None` if two in a row took longer than `limit`.
fn walls(
    driver: &mut Driver,
    run: &Run<'_>,
    frames: &[Frame],
    limit: f64,
) -> Result<Option<Vec<f64>>, Stop> {
    let mut walls: Vec<f64> = Vec::with_capacity(frames.len());
    let frames = frames.iter().copied();
    let done = driver.run(frames, run.query, false, |record, _| {
        let before = walls.last().copied().unwrap_or(0.0);
        walls.push(record.wall_ms);
        match before.min(record.wall_ms) > limit {
            true => Err(Halt::Hopeless),
            false => Ok(()),
        }
    });
    match done {
        Ok(()) => Ok(Some(walls)),
        Err(Halt::Stop(stop)) => Err(stop),
        Err(Halt::Hopeless) => {
            while driver.finish(None)?.is_some() {}
            Ok(None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::{Query, QueryKind, Rays};
    use pipeline::Pace;

    const ASYNC: Update = Update::Async(Pace::Free);

    fn outcome(all: &[(Update, f64, bool)]) -> Outcome {
        let timed = all.iter().map(|&(update, ms, at_least)| Timed {
            update,
            method: Method::default(),
            ms,
            first_ms: 0.0,
            at_least,
        });
        Outcome {
            timed: timed.collect(),
            left_out: Vec::new(),
            frames: 48,
        }
    }

    fn taken(all: &[(Update, f64, bool)], usual: Update) -> Option<Update> {
        let usual = (usual, Method::default());
        outcome(all).fastest(usual).map(|t| t.update)
    }

    #[test]
    fn the_usual_is_kept_where_nothing_is_faster_beyond_noise() {
        let all = [
            (ASYNC, 10.2, false),
            (Update::TSah, 10.0, false),
            (Update::Refit, 30.0, false),
        ];
        assert_eq!(taken(&all, ASYNC), Some(ASYNC));
        assert_eq!(taken(&all, Update::Refit), Some(Update::TSah));
        assert_eq!(taken(&all, Update::Rebuild), Some(Update::TSah));
        assert_eq!(taken(&[], ASYNC), None);
        let slower = [(ASYNC, 10.4, false), (Update::TSah, 10.0, false)];
        assert_eq!(taken(&slower, ASYNC), Some(Update::TSah));
    }

    #[test]
    fn who_was_given_up_is_not_taken() {
        let all = [(ASYNC, 3.0, false), (Update::Refit, 1.0, true)];
        assert_eq!(taken(&all, Update::Refit), Some(ASYNC));
    }

    /// A run of 100 frames of 1 ms on a scene whose first tree decays so much.
    fn hopeless(update: Update, decay: f64, build_ms: f64, best: f64) -> Option<String> {
        let facts = Facts::decayed(decay);
        let run = Run {
            frames: &[],
            query: Query {
                rays: Rays::List(&[]),
                kind: QueryKind::Closest,
            },
        };
        let guess = Guess {
            frames: 100,
            frame_ms: 1.0,
            build_ms,
        };
        let trial = Trial::within(3000.0, 5, guess, (&run, &facts)).unwrap();
        trial.hopeless(update, best)
    }

    #[test]
    fn who_cannot_win_is_left_out_and_the_reason_named() {
        let tried =
            |update, decay, build_ms, best| hopeless(update, decay, build_ms, best).is_none();
        assert!(tried(Update::Refit, 2.0, 10.0, 1.0));
        assert!(!tried(Update::Refit, 30.0, 10.0, 1.0));
        assert!(tried(Update::Rebuild, 1.0, 10.0, 20.0));
        assert!(!tried(Update::Rebuild, 1.0, 10.0, 1.0));
        assert!(
            tried(Update::TSah, 300.0, 90.0, 1.0),
            "a tree for all takes 1 s"
        );
        let why = hopeless(Update::TSah, 1.0, 300.0, 1.0).unwrap();
        assert!(why.contains("3.3 s"), "{why}");
        assert!(tried(ASYNC, 300.0, 90.0, f64::INFINITY));
    }
}
