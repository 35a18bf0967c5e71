//! What `auto` takes, found out by trying: a few frames of the run itself, on the backend that will do it.
//!
//! First every method left open (intersector, layout) is timed; then the cheapest that meets the
//! tolerance is taken, and with it every update policy is timed over all parts of the run. Lists of methods and
//! policies are those of the command line, so that whatever is added there is tried here. Where there is no time for
//! that, a rule decides by how the first tree decays over a sample of triangles.
//!
//! **Time.** Policies are tried for at most [`LEAST_MS`] or [`SHARE`] of the run, and the one under way is not cut short;
//! methods before that take some frames each.
//!
//! **Tolerance 0 is not measured but proven:** no sample shows that a rate is zero, and by definition
//! (`ARCHITECTURE.md`, "What a hit is") `exact` alone is free of wrong answers. A tolerance above 0 is shown by a
//! sample of the run's own rays, at 95 % confidence; where that would take too many rays, `exact` is taken.
//!
//! What is hit does not depend on policy and layout, so that what they were chosen by cannot show in
//! any answer. The intersector can; it is therefore left to `auto` only by name.

mod facts;
mod methods;
mod plan;
mod policies;
mod sample;
mod stand;

use crate::args::{IntersectorName, LayoutName, UpdateName};
use crate::choose;
use crate::session::Ask;
use crate::stop::Stop;
use crate::table::{FRAMES, counted};
use backend::{Intersector, Layout, Method, Query};
use clap::ValueEnum;
use facts::Facts;
use geom::Animation;
use pipeline::{Frame, Update};
use plan::Guess;
use policies::{Outcome, Timed, Trial};
use sample::{Sample, Wrong};
pub(crate) use stand::TrialBackend;

/// Fewer frames are not worth a trial.
const FEW: usize = 16;
/// Milliseconds that a trial of update policies may take, however short the run.
const LEAST_MS: f64 = 3000.0;
/// Share of the run that it may take if that is longer.
const SHARE: f64 = 0.05;
/// A method this many times slower is as fast: each has the least device time of [`methods::FRAMES`] frames, twice.
const METHOD_NOISE: f64 = 1.03;

/// The run that something is chosen for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'a> {
    /// Its frames.
    pub(crate) frames: &'a [Frame],
    /// What is traced in each.
    pub(crate) query: Query<'a>,
}

/// What is taken, with a reason for each part that was left open.
#[derive(Clone, Debug)]
pub(crate) struct Settled {
    /// How rays are traced.
    pub(crate) method: Method,
    /// How trees follow the motion.
    pub(crate) update: Update,
    /// Intersectors that are known to meet the tolerance.
    pub(crate) meets: Vec<Intersector>,
    /// Why this update policy.
    pub(crate) why_update: Option<String>,
    /// Why this intersector.
    pub(crate) why_intersector: Option<String>,
    /// Why this layout.
    pub(crate) why_layout: Option<String>,
}

impl Settled {
    /// What is taken without a trial.
    pub(crate) fn by_rule(ask: &Ask<'_>) -> Self {
        let intersector = choose::intersector(ask.method.intersector);
        let layout = choose::layout(ask.method.layout);
        let owned = |why: Option<&str>| why.map(str::to_owned);
        Self {
            method: choose::method(ask.method),
            update: ask.update.value,
            meets: vec![intersector.value],
            why_update: owned(ask.update.why),
            why_intersector: owned(intersector.why),
            why_layout: owned(layout.why),
        }
    }

    /// Decides by how the first tree decays, where nothing is measured.
    fn by_facts(&mut self, facts: &Facts, update_is_open: bool) {
        let rule = match &mut self.why_update {
            Some(why) if update_is_open => why,
            _ => return,
        };
        if matches!(self.update, Update::Async(_)) && facts.tree_lasts() {
            self.update = Update::Refit;
            "the first tree stays as good as a fresh one".clone_into(rule);
        }
        *rule = format!("{rule}; {facts}");
    }

    /// Takes another layout than was measured to be the best, for a policy that goes with it.
    fn take_layout(&mut self, method: Method) {
        if let (Some(why), true) = (&mut self.why_layout, method != self.method) {
            *why += "; but the update policy goes with this one";
        }
        self.method = method;
    }

    /// Gives what was measured for reasons, where there was something to choose from.
    fn explain(&mut self, timed: &[methods::Timed], told: &str) {
        let taken = self.method;
        let times = |of: fn(Method, Method) -> bool, name: fn(Method) -> String| {
            let all: Vec<_> = timed.iter().filter(|t| of(t.method, taken)).collect();
            let named = all.iter().map(|t| (name(t.method), t.ms));
            (all.len() > 1).then(|| format!("ms on the device: {}", listed(named)))
        };
        let of_intersectors = times(
            |a, b| a.layout == b.layout,
            |m| m.intersector.name().to_owned(),
        );
        if let (Some(why), Some(times)) = (&mut self.why_intersector, of_intersectors) {
            *why = format!("the cheapest within the tolerance ({told}); {times}");
        }
        let of_layouts = times(
            |a, b| a.intersector == b.intersector,
            |m| m.layout.name().to_owned(),
        );
        if let (Some(why), Some(times)) = (&mut self.why_layout, of_layouts) {
            *why = format!("measured, {times}");
        }
    }
}

/// Settles what `ask` leaves open, by trial where there is a run to try and it is long enough.
///
/// # Errors
/// No method left open can be traced by.
pub(crate) fn settle(stand: &mut TrialBackend<'_>, ask: &Ask<'_>) -> Result<Settled, Stop> {
    let mut settled = Settled::by_rule(ask);
    let candidates = candidates(stand, ask);
    let open = candidates.len() > 1 || ask.update.is_open;
    let Some(run) = ask.run.filter(|run| open && !run.frames.is_empty()) else {
        return Ok(settled);
    };
    let facts = Facts::of(stand.animation(), &run)?;
    if run.frames.len() < FEW {
        settled.by_facts(&facts, ask.update.is_open);
        return Ok(settled);
    }
    let timed = methods::time(stand, &candidates, &run)?;
    let taken = take_method(stand, ask, (&run, &timed), &mut settled)?;
    if ask.update.is_open {
        let guess = Guess {
            frames: run.frames.len(),
            frame_ms: taken.ms,
            build_ms: taken.build_ms,
        };
        let layouts = layouts(&candidates, taken.method);
        take_update(stand, (&run, &facts, guess), &layouts, &mut settled)?;
    } else if let (Some(why), true) = (&mut settled.why_intersector, candidates.len() > 1) {
        *why = format!("{why}; {facts}");
    }
    Ok(settled)
}

/// Candidates that differ from a method in layout alone, itself included.
fn layouts(candidates: &[Method], taken: Method) -> Vec<Method> {
    let same = candidates.iter().copied();
    same.filter(|m| m.intersector == taken.intersector)
        .collect()
}

/// The methods left open, as far as the backend has them.
fn candidates(stand: &TrialBackend<'_>, ask: &Ask<'_>) -> Vec<Method> {
    let fixed = choose::method(ask.method);
    let intersectors = match ask.method.intersector {
        // Nothing else is free of wrong answers by definition.
        IntersectorName::Auto if ask.tolerance > 0.0 => Intersector::ALL.to_vec(),
        _ => vec![fixed.intersector],
    };
    let layouts = match ask.method.layout {
        LayoutName::Auto => Layout::ALL.to_vec(),
        _ => vec![fixed.layout],
    };
    let with = |&intersector: &Intersector| {
        layouts.iter().map(move |&layout| Method {
            intersector,
            layout,
        })
    };
    let all = intersectors.iter().flat_map(with);
    all.filter(|&m| stand.supports(m)).collect()
}

/// The fastest that meets the tolerance.
fn take_method(
    stand: &mut TrialBackend<'_>,
    ask: &Ask<'_>,
    (run, timed): (&Run<'_>, &[methods::Timed]),
    settled: &mut Settled,
) -> Result<methods::Timed, Stop> {
    let mut judge = Verifier::new(ask.tolerance, settled.method.intersector);
    let mut meets = |&t: &methods::Timed| Ok(judge.meets(stand, run, t.method)?.then_some(t));
    let all: Result<Vec<_>, Stop> = timed.iter().map(&mut meets).collect();
    let fit: Vec<_> = all?.into_iter().flatten().collect();
    let Some(&fastest) = fit.first() else {
        return Err(Stop::bad(format!(
            "no intersector of this backend stays within {} wrong rays a million; exact does, on others",
            ask.tolerance
        )));
    };
    let usual = fit.iter().find(|t| t.method == settled.method);
    let taken = *usual
        .filter(|u| u.ms <= METHOD_NOISE * fastest.ms)
        .unwrap_or(&fastest);
    settled.method = taken.method;
    settled.meets = fit.iter().map(|t| t.method.intersector).collect();
    let told = judge.told.join(", ");
    settled.explain(timed, &told);
    Ok(taken)
}

/// Who meets the tolerance; each intersector is judged once.
struct Verifier {
    tolerance: f64,
    /// Good enough unseen: the one asked for by name, or `exact`.
    sure: Intersector,
    sample: Option<Sample>,
    known: Vec<(Intersector, bool)>,
    told: Vec<String>,
}

impl Verifier {
    fn new(tolerance: f64, sure: Intersector) -> Self {
        Self {
            tolerance,
            sure,
            sample: None,
            known: Vec::new(),
            told: Vec::new(),
        }
    }

    fn meets(
        &mut self,
        stand: &mut TrialBackend<'_>,
        run: &Run<'_>,
        m: Method,
    ) -> Result<bool, Stop> {
        if m.intersector == self.sure || m.intersector == Intersector::Exact {
            return Ok(true);
        }
        if let Some(&(_, meets)) = self.known.iter().find(|k| k.0 == m.intersector) {
            return Ok(meets);
        }
        let meets = match sample::needed(self.tolerance) {
            None => false,
            Some(count) => {
                let sample = match self.sample.take() {
                    Some(sample) => sample,
                    None => Sample::take(stand, run, count)?,
                };
                let wrong = sample.wrong(stand, m)?;
                self.sample = Some(sample);
                self.told.push(tell(m.intersector, wrong));
                wrong.at_most() <= self.tolerance
            }
        };
        self.known.push((m.intersector, meets));
        Ok(meets)
    }
}

fn tell(intersector: Intersector, w: Wrong) -> String {
    let Wrong { wrong, rays } = w;
    let most = w.at_most();
    format!("{intersector} {wrong} of {rays} rays wrong, at most {most:.1} a million")
}

/// The fastest policy over the run, if there is time to find out.
fn take_update(
    stand: &mut TrialBackend<'_>,
    (run, facts, guess): (&Run<'_>, &Facts, Guess),
    layouts: &[Method],
    settled: &mut Settled,
) -> Result<(), Stop> {
    let updates = updates(stand.animation(), run.frames);
    let with = |update| match update {
        // It may not have the layout that is best for the others.
        Update::DeviceRebuild if !stand.makes_trees() => Vec::new(),
        Update::DeviceRebuild => layouts.iter().map(|&method| (update, method)).collect(),
        _ => vec![(update, settled.method)],
    };
    let candidates: Vec<_> = updates.into_iter().flat_map(with).collect();
    let allowance = LEAST_MS.max(SHARE * guess.frames as f64 * guess.frame_ms);
    let Some(trial) = Trial::within(allowance, candidates.len(), guess, (run, facts)) else {
        settled.by_facts(facts, true);
        if let Some(why) = &mut settled.why_update {
            *why += "; trying out would take too long for this run";
        }
        return Ok(());
    };
    let outcome = trial.time(stand, candidates)?;
    if let Some(taken) = outcome.fastest((settled.update, settled.method)) {
        settled.update = taken.update;
        settled.take_layout(taken.method);
    }
    let seconds = trial.elapsed_ms() * 1e-3;
    settled.why_update = Some(format!(
        "{}; found out in {seconds:.1} s; {facts}",
        measured(&outcome, settled.update)
    ));
    Ok(())
}

/// What a trial found, the fastest first.
fn measured(outcome: &Outcome, taken: Update) -> String {
    let mut all: Vec<&Timed> = outcome.timed.iter().collect();
    all.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    let layouts = outcome.timed.iter().map(|t| t.method.layout);
    let differ = layouts
        .clone()
        .any(|l| layouts.clone().any(|other| l != other));
    let word = |t: &&Timed| {
        let over = if t.at_least { " over" } else { "" };
        let layout = if differ && t.update == Update::DeviceRebuild {
            format!(" {}", t.method.layout)
        } else {
            String::new()
        };
        format!(
            "{}{layout}{over} {:.2}",
            choose::update_name(t.update),
            t.ms
        )
    };
    let words: Vec<_> = all.iter().map(word).collect();
    let mut text = format!(
        "measured over {}, ms each: {}",
        counted(outcome.frames, FRAMES),
        words.join(", ")
    );
    outcome
        .left_out
        .iter()
        .for_each(|why| text += &format!("; {why}"));
    if let (Update::TSah, Some(t)) = (taken, all.iter().find(|t| t.update == taken)) {
        text += &format!("; its first frame takes {:.0} ms", t.first_ms);
    }
    text
}

/// All update policies but those that are refused unseen.
fn updates(animation: &Animation, frames: &[Frame]) -> Vec<Update> {
    let named = UpdateName::value_variants().iter();
    let named = named.filter(|&&name| name != UpdateName::Auto);
    let all = named.filter_map(|&update| {
        let lockstep = None;
        let policy = crate::args::PolicyArgs { update, lockstep };
        Some(choose::update(policy, animation, frames).ok()?.value)
    });
    all.collect()
}

/// How many times slower is as fast, measured over so many frames: 3 % with 48 of them, 12 % with 3.
fn noise(frames: usize) -> f64 {
    1.0 + 0.2 / (frames as f64).sqrt()
}

/// Names with times, the least first.
fn listed(all: impl Iterator<Item = (String, f64)>) -> String {
    let mut all: Vec<_> = all.collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let words: Vec<_> = all
        .iter()
        .map(|(name, ms)| format!("{name} {ms:.2}"))
        .collect();
    words.join(", ")
}

#[cfg(test)]
mod tests;
