//! `abvh crossover`: where `async` pays and where something else does, over size, speed of the motion and builder threads.

mod text;

use crate::args::{CrossoverArgs, LayoutName, UpdateName};
use crate::progress::Progress;
use crate::stop::Stop;
use crate::timing::{self, FOR_ALL, NOISE, Setting, Timing, Way, layout_name, name};
use crate::{conflicts, info, record, talk, threads};
use pipeline::Frame;
use scene::Scene;
use serde::Serialize;

/// Builder threads of a table unless asked otherwise, as far as the machine has them.
const THREADS: [usize; 3] = [2, 4, 16];

#[derive(Serialize)]
struct Report {
    schema: u32,
    version: &'static str,
    command_line: Vec<String>,
    cpu: Option<String>,
    cores: usize,
    size: [u32; 2],
    speeds: Vec<f64>,
    cells: Vec<Cell>,
    /// What was left out, and why.
    left_out: Vec<String>,
}

/// One size at one speed with so many builder threads.
#[derive(Clone, Serialize)]
struct Cell {
    scene: String,
    triangles: usize,
    /// Key frames a frame.
    speed: f64,
    builder_threads: usize,
    /// `async`, then what it is set against.
    runs: Vec<Run>,
    /// The fastest, and all that are as fast but for noise; by name.
    winners: Vec<&'static str>,
    /// The fastest over `async`.
    over_async: Option<f64>,
}

/// One policy in its fastest layout.
#[derive(Clone, Serialize)]
struct Run {
    update: &'static str,
    layout: String,
    /// Its frame over that of `async`.
    over_async: Option<f64>,
    #[serde(flatten)]
    timing: Timing,
}

/// Fills the table.
pub(crate) fn run(args: &CrossoverArgs) -> Result<(), Stop> {
    conflicts::of_files(&args.scenes, [], [("--json", args.json.as_ref())])?;
    if let Some(file) = &args.json {
        report::check_writable(file).map_err(Stop::bad)?;
    }
    let mut table = Table::new(args);
    for scene in &args.scenes {
        for &triangles in &args.triangles.triangles.0 {
            let spec = format!("{scene}:{triangles}");
            let scene = scene::open(&spec, &scene::Options::default())?;
            for &speed in &args.speeds {
                table.fill(&spec, &scene, speed)?;
            }
        }
    }
    let Table {
        cells, left_out, ..
    } = table;
    let Some(first) = cells.first().and_then(|c| c.runs.first()) else {
        let why = left_out.first().cloned();
        return Err(Stop::bad(
            why.unwrap_or_else(|| "nothing to compare".to_owned()),
        ));
    };
    let adapter = first.timing.device.adapter.clone();
    let report = Report {
        schema: report::SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        command_line: record::command_line(),
        cpu: info::cpu_model(),
        cores: threads::cores(),
        size: args.timing.size.size,
        speeds: args.speeds.clone(),
        cells,
        left_out,
    };
    if let Some(file) = &args.json {
        report::write_json(file, &report)?;
    }
    talk::print(&text::text(&report, &adapter))
}

/// All that is under way.
struct Table<'a> {
    args: &'a CrossoverArgs,
    setting: Setting<'a>,
    threads: Vec<usize>,
    progress: Progress,
    cells: Vec<Cell>,
    left_out: Vec<String>,
}

impl<'a> Table<'a> {
    fn new(args: &'a CrossoverArgs) -> Self {
        let threads = builder_threads(&args.threads, threads::cores());
        let places = args.scenes.len() * args.triangles.triangles.0.len() * args.speeds.len();
        let runs = (threads.len() + args.against.len()) * args.layouts.layout.len();
        Self {
            args,
            setting: args.timing.setting(),
            threads,
            progress: Progress::new((places * runs) as u64, args.timing.quiet),
            cells: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// One cell for each number of builder threads. The policies that `async` is set against wait for no builder once
    /// they run, so each is timed once.
    fn fill(&mut self, spec: &str, scene: &Scene, speed: f64) -> Result<(), Stop> {
        let frames = timing::ping_pong(scene.animation.end(), speed, self.args.timing.frames);
        let mut rivals = Vec::new();
        let mut build_ms: f64 = 0.0;
        let mut own = Vec::new();
        for &threads in &self.threads.clone() {
            let run = self.fastest(
                (spec, scene),
                &frames,
                (UpdateName::Async, Some(threads)),
                build_ms,
            )?;
            own.extend(run.map(|run| (threads, run)));
        }
        for (_, run) in &own {
            build_ms = build_ms.max(run.timing.build_ms.unwrap_or(0.0));
        }
        for &update in &self.args.against {
            rivals.extend(self.fastest((spec, scene), &frames, (update, None), build_ms)?);
        }
        let triangles = scene.animation.triangle_count();
        let cell = |(threads, run): (usize, Run)| {
            let all = std::iter::once(run).chain(rivals.iter().cloned());
            Cell::of((spec, triangles, speed, threads), all.collect())
        };
        self.cells.extend(own.into_iter().map(cell));
        Ok(())
    }

    /// One policy by its fastest layout; `None` if it cannot be had, which is remarked.
    fn fastest(
        &mut self,
        (spec, scene): (&str, &Scene),
        frames: &[Frame],
        (update, builder_threads): (UpdateName, Option<usize>),
        build_ms: f64,
    ) -> Result<Option<Run>, Stop> {
        let longest = self.args.timing.longest_build;
        let seconds = FOR_ALL * build_ms * 1e-3;
        if update == UpdateName::TSah && seconds > longest {
            let why =
                format!("its tree would take about {seconds:.0} s to build, more than {longest}");
            self.leave_out(format!("{spec} {}: {why}", name(update)));
            return Ok(None);
        }
        let mut best: Option<Run> = None;
        for &layout in &self.args.layouts.layout.clone() {
            let way = Way {
                update,
                layout,
                builder_threads,
            };
            let what = format!("{spec} {} {}", name(update), layout_name(layout));
            match timing::time(&self.setting, &scene.animation, frames, way) {
                Ok(timing) => {
                    let run = Run::of(update, layout, timing);
                    if best
                        .as_ref()
                        .is_none_or(|b| run.timing.frame_ms < b.timing.frame_ms)
                    {
                        best = Some(run);
                    }
                }
                Err(stop) => self.leave_out(format!("{what}: {stop}")),
            }
            self.progress.step(&what);
        }
        Ok(best)
    }

    fn leave_out(&mut self, why: String) {
        if !self.left_out.contains(&why) {
            self.progress.say(&format!("left out: {why}"));
            self.left_out.push(why);
        }
    }
}

impl Run {
    fn of(update: UpdateName, layout: LayoutName, timing: Timing) -> Self {
        Self {
            update: name(update),
            layout: layout_name(layout),
            over_async: None,
            timing,
        }
    }
}

impl Cell {
    /// Of runs of which the first is `async`.
    fn of(
        (scene, triangles, speed, builder_threads): (&str, usize, f64, usize),
        mut runs: Vec<Run>,
    ) -> Self {
        let own = runs.first().map_or(f64::NAN, |r| r.timing.frame_ms);
        let over = |ms: f64| (own > 0.0).then(|| ms / own);
        runs.iter_mut()
            .for_each(|r| r.over_async = over(r.timing.frame_ms));
        let least = runs
            .iter()
            .map(|r| r.timing.frame_ms)
            .fold(f64::INFINITY, f64::min);
        let mut close: Vec<&Run> = runs
            .iter()
            .filter(|r| r.timing.frame_ms <= (1.0 + NOISE) * least)
            .collect();
        close.sort_by(|a, b| a.timing.frame_ms.total_cmp(&b.timing.frame_ms));
        Self {
            scene: scene.to_owned(),
            triangles,
            speed,
            builder_threads,
            winners: close.iter().map(|r| r.update).collect(),
            over_async: over(least),
            runs,
        }
    }
}

/// Those asked for, else the usual ones that there are cores for.
fn builder_threads(asked: &[usize], cores: usize) -> Vec<usize> {
    if !asked.is_empty() {
        return asked.to_vec();
    }
    let usual: Vec<usize> = THREADS.into_iter().filter(|&n| n <= cores).collect();
    match usual.is_empty() {
        true => vec![cores],
        false => usual,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use backend::{Device, DeviceKind};

    pub(super) fn run(update: &'static str, frame_ms: f64, cut_short: bool) -> Run {
        let device = Device {
            backend: "cpu",
            adapter: String::new(),
            driver: String::new(),
            kind: DeviceKind::Cpu,
            threads: 1,
            arithmetic: backend::Arithmetic::IEEE,
        };
        Run {
            update,
            layout: "fast".to_owned(),
            over_async: None,
            timing: Timing {
                device,
                builder_threads: 1,
                frame_ms,
                geometry_ms: None,
                trace_ms: None,
                first_ms: 5.0,
                build_ms: None,
                device_bytes: None,
                warm_up: None,
                frames: 9,
                cut_short,
            },
        }
    }

    #[test]
    fn who_is_as_fast_but_for_noise_wins_too() {
        let runs = vec![
            run("async", 2.0, false),
            run("t-sah", 1.02, false),
            run("refit", 1.0, false),
        ];
        let cell = Cell::of(("s", 10, 0.5, 2), runs);
        assert_eq!(cell.winners, ["refit", "t-sah"]);
        assert_eq!(cell.over_async, Some(0.5));
        assert_eq!(cell.runs[1].over_async, Some(0.51));
        let alone = Cell::of(("s", 10, 0.5, 2), vec![run("async", 2.0, false)]);
        assert_eq!(
            (alone.winners, alone.over_async),
            (vec!["async"], Some(1.0))
        );
    }

    #[test]
    fn builder_threads_are_those_that_there_are_cores_for() {
        assert_eq!(builder_threads(&[], 16), [2, 4, 16]);
        assert_eq!(builder_threads(&[], 8), [2, 4]);
        assert_eq!(builder_threads(&[], 1), [1]);
        assert_eq!(builder_threads(&[64], 2), [64]);
    }
}
