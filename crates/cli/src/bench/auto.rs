//! What `auto` takes, against every fixed choice it has: same scene, same backend, turn by turn.

use super::{Row, Run, mean, measure};
use crate::ahead::Ahead;
use crate::args::{
    BackendName, BenchArgs, IntersectorName, LayoutName, MethodArgs, PolicyArgs, RaysName, Switch,
    UpdateName,
};
use crate::progress::Progress;
use crate::session::Ask;
use crate::stop::Stop;
use crate::table::{ms, table};
use crate::{choose, open};
use clap::ValueEnum;
use pipeline::Frame;
use report::{Summary, Taken};
use scene::Scene;
use serde::Serialize;

/// How `auto` fared against fixed choices. Milliseconds of the host's clock.
#[derive(Serialize)]
pub(super) struct Check {
    scene: String,
    backend: &'static str,
    /// Wrong rays a million that the intersector may have, if that is left to `auto`.
    tolerance: Option<f64>,
    fixed: Vec<Fixed>,
    /// What `auto` took, once a round.
    takes: Vec<String>,
    /// Its reasons in the last round.
    auto: Vec<Taken>,
    best: String,
    best_ms: f64,
    /// The worst over the rounds: what was taken over the best that meets the tolerance.
    ratio: Option<f64>,
    /// Runs of `auto` itself over the best that meets the tolerance.
    own_ratio: Option<f64>,
    /// As `ratio`, by means instead of medians.
    mean_ratio: Option<f64>,
}

/// One fixed choice.
#[derive(Serialize)]
struct Fixed {
    choice: String,
    meets_tolerance: bool,
    /// Median over all frames but the first.
    wall_ms: f64,
    device_ms: f64,
    /// Mean over the same frames.
    mean_ms: f64,
    /// The first frame, which waits for the first tree: start-up.
    first_ms: f64,
}

/// Runs of one choice.
struct Pool {
    choice: String,
    intersector: &'static str,
    ask: (PolicyArgs, MethodArgs),
    rows: Vec<Row>,
}

/// A scene to compare on.
pub(super) struct Place<'a> {
    pub(super) args: &'a BenchArgs,
    pub(super) tolerance: f64,
    pub(super) spec: &'a str,
    pub(super) scene: &'a Scene,
    pub(super) frames: &'a [Frame],
}

impl Place<'_> {
    /// Runs every fixed choice and `auto`, in rounds; hands back the first run of each.
    pub(super) fn check(
        &self,
        (backend, intersector): (BackendName, IntersectorName),
        progress: &mut Progress,
    ) -> Result<(Check, Vec<Row>), Stop> {
        let open = (
            policy(UpdateName::Auto),
            MethodArgs {
                intersector,
                layout: LayoutName::Auto,
            },
        );
        let mut own = vec![self.run(backend, open)?];
        let name = BackendName::from_str(own[0].backend, true).unwrap_or(backend);
        let mut pools: Vec<Pool> = fixed(name, intersector).map(Pool::new).collect();
        progress.lengthen((pools.len() * self.args.rounds) as u64);
        for round in 0..self.args.rounds {
            if round > 0 {
                own.push(self.run(backend, open)?);
            }
            let mut kept = Vec::new();
            for mut pool in pools {
                let step = format!("{} {}", self.spec, pool.choice);
                match self.run(name, pool.ask) {
                    Ok(row) => {
                        pool.add(row);
                        progress.step(&step);
                        kept.push(pool);
                    }
                    Err(stop) => progress.step(&format!("{step} is left out: {stop}")),
                }
            }
            pools = kept;
        }
        let tolerance = (intersector == IntersectorName::Auto).then_some(self.tolerance);
        let check = self.judge(&own, &pools, tolerance)?;
        let first = own.into_iter().take(1);
        let rows = first.chain(pools.into_iter().filter_map(|p| p.rows.into_iter().next()));
        Ok((check, rows.collect()))
    }

    fn run(&self, backend: BackendName, ask: (PolicyArgs, MethodArgs)) -> Result<Row, Stop> {
        let (policy, method) = ask;
        let args = self.args;
        let ask = Ask {
            backend,
            adapter: args.adapter.as_deref(),
            threads: args.threads,
            builder_threads: args.builder_threads,
            method,
            update: choose::update(policy, &self.scene.animation, self.frames)?,
            tolerance: self.tolerance,
            run: None,
            ahead: Ahead::of(self.frames, Switch::On),
        };
        let run = Run {
            rays: RaysName::Camera,
            size: args.size.size,
            warm_up: args.warm_up.warm_up(),
            dwell: None,
        };
        measure(run, (self.spec, self.scene), self.frames, &ask)
    }

    fn judge(&self, own: &[Row], pools: &[Pool], tolerance: Option<f64>) -> Result<Check, Stop> {
        let [.., last] = own else {
            return Err(Stop::failed("auto was never asked"));
        };
        let meets = |p: &Pool| own.iter().all(|row| row.meets.contains(&p.intersector));
        let fixed: Vec<Fixed> = pools
            .iter()
            .map(|p| Fixed {
                choice: p.choice.clone(),
                meets_tolerance: meets(p),
                wall_ms: wall_ms(&p.rows),
                device_ms: device_ms(&p.rows),
                mean_ms: mean_ms(&p.rows),
                first_ms: first_ms(&p.rows),
            })
            .collect();
        let fit = fixed.iter().filter(|f| f.meets_tolerance);
        let least_mean = fit.clone().map(|f| f.mean_ms).fold(f64::INFINITY, f64::min);
        let best = fit.min_by(|a, b| a.wall_ms.total_cmp(&b.wall_ms));
        let best = best.ok_or_else(|| Stop::failed("no fixed choice meets the tolerance"))?;
        let takes: Vec<String> = own.iter().map(name).collect();
        let of = |choice: &String| fixed.iter().find(|f| f.choice == *choice);
        let worst = |ratio: &dyn Fn(&Fixed) -> f64| {
            let all: Option<Vec<f64>> = takes.iter().map(|t| of(t).map(ratio)).collect();
            all?.into_iter().reduce(f64::max)
        };
        Ok(Check {
            scene: self.spec.to_owned(),
            backend: last.backend,
            tolerance,
            best: best.choice.clone(),
            best_ms: best.wall_ms,
            ratio: worst(&|f| f.wall_ms / best.wall_ms),
            mean_ratio: worst(&|f| f.mean_ms / least_mean),
            own_ratio: (best.wall_ms > 0.0).then(|| wall_ms(own) / best.wall_ms),
            auto: last.auto.clone(),
            takes,
            fixed,
        })
    }
}

impl Pool {
    fn new(ask: (PolicyArgs, MethodArgs)) -> Self {
        Self {
            choice: String::new(),
            intersector: "",
            ask,
            rows: Vec::new(),
        }
    }

    fn add(&mut self, row: Row) {
        self.choice = name(&row);
        self.intersector = row.intersector;
        self.rows.push(row);
    }
}

fn policy(update: UpdateName) -> PolicyArgs {
    PolicyArgs {
        update,
        lockstep: None,
    }
}

/// Every choice that is left to `auto`, as far as the backend has it.
fn fixed(
    backend: BackendName,
    intersector: IntersectorName,
) -> impl Iterator<Item = (PolicyArgs, MethodArgs)> {
    let intersectors = match intersector {
        IntersectorName::Auto => IntersectorName::value_variants().to_vec(),
        named => vec![named],
    };
    let with_layouts = |intersector| {
        let layouts = LayoutName::value_variants().iter();
        layouts.map(move |&layout| MethodArgs {
            intersector,
            layout,
        })
    };
    let all: Vec<MethodArgs> = intersectors.into_iter().flat_map(with_layouts).collect();
    let is_fixed =
        |m: &MethodArgs| m.intersector != IntersectorName::Auto && m.layout != LayoutName::Auto;
    let methods = all.into_iter().filter(is_fixed);
    let methods = methods.filter(move |&m| open::lacks(backend, choose::method(m)).is_none());
    let makes_trees = open::makes_trees(backend);
    methods.flat_map(move |method| {
        let named = UpdateName::value_variants().iter();
        let named = named.filter(move |&&u| {
            u != UpdateName::Auto && (u != UpdateName::DeviceRebuild || makes_trees)
        });
        named.map(move |&update| (policy(update), method))
    })
}

/// What a run was done by.
fn name(row: &Row) -> String {
    format!("{} {} {}", row.update, row.intersector, row.layout)
}

/// The median over all frames but the first of each run, which builds the first tree.
fn wall_ms(rows: &[Row]) -> f64 {
    let all = rows.iter().flat_map(|r| r.per_frame.iter().skip(1));
    Summary::of(all.filter_map(|f| f.wall_ms)).map_or(f64::NAN, |s| s.median)
}

/// Their mean.
fn mean_ms(rows: &[Row]) -> f64 {
    let all = rows.iter().flat_map(|r| r.per_frame.iter().skip(1));
    mean(all.filter_map(|f| f.wall_ms)).unwrap_or(f64::NAN)
}

/// The mean of first frames.
fn first_ms(rows: &[Row]) -> f64 {
    let first = rows.iter().filter_map(|r| r.per_frame.first());
    mean(first.filter_map(|f| f.wall_ms)).unwrap_or(f64::NAN)
}

fn device_ms(rows: &[Row]) -> f64 {
    let all = rows.iter().flat_map(|r| r.per_frame.iter().skip(1));
    Summary::of(all.filter_map(|f| f.device_ms)).map_or(f64::NAN, |s| s.median)
}

/// Every choice with its times, then what `auto` took.
pub(super) fn text(checks: &[Check]) -> String {
    let mut rows = Vec::new();
    for check in checks {
        let at = |choice: String| {
            let tolerance = check.tolerance.map_or("-".to_owned(), |t| t.to_string());
            vec![
                check.scene.clone(),
                check.backend.to_owned(),
                tolerance,
                choice,
            ]
        };
        for f in &check.fixed {
            let ratio = format!("{:.3}", f.wall_ms / check.best_ms);
            let misses = if f.meets_tolerance {
                ""
            } else {
                " (misses it)"
            };
            let mut row = at(format!("{}{misses}", f.choice));
            row.extend([f.first_ms, f.mean_ms, f.device_ms, f.wall_ms].map(ms));
            row.push(ratio);
            rows.push(row);
        }
        let mut takes = check.takes.clone();
        takes.dedup();
        let show = |r: Option<f64>| r.map_or("-".to_owned(), |r| format!("{r:.3}"));
        let mut row = at(format!("auto: {}", takes.join(", then ")));
        row.extend([
            String::new(),
            show(check.mean_ratio) + " of the least",
            String::new(),
            show(check.own_ratio) + " by itself",
            show(check.ratio),
        ]);
        rows.push(row);
    }
    let head = [
        "scene",
        "backend",
        "tolerance",
        "choice",
        "first frame",
        "mean",
        "device",
        "wall",
        "over the best",
    ];
    format!(
        "what auto takes, and all it could have taken; mean and medians (device, wall) of all frames but the first\n{}",
        table(&head, &rows, 4)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_of_the_command_line_is_fixed_once() {
        let all: Vec<_> = fixed(BackendName::Cpu, IntersectorName::Auto).collect();
        // Neither auto nor device-rebuild.
        let updates = UpdateName::value_variants().len() - 2;
        let methods = all.len() / updates;
        assert!(
            methods >= 4 && all.len() == methods * updates,
            "{}",
            all.len()
        );
        let one = fixed(BackendName::Cpu, IntersectorName::Woop);
        assert!(one.into_iter().all(|(p, m)| {
            m.intersector == IntersectorName::Woop && p.update != UpdateName::Auto
        }));
    }
}
