//! `abvh growth`: time, memory and start-up over the number of triangles, as a picture and as tables.
//!
//! Peak host memory and most of the time go into the largest scenes: they are generated one at a time, each run loads
//! its own, and each builds its first tree. Where the time went is told with the result.

use crate::args::{GrowthArgs, LayoutName, UpdateName};
use crate::chart::write_texts;
use crate::progress::Progress;
use crate::stop::Stop;
use crate::table::{grouped, markdown};
use crate::timing::{self, FOR_ALL, Setting, Timing, Way, layout_name, name};
use crate::warm_up::Warmed;
use crate::{info, talk};
use backend::DeviceBytes;
use chart::{Adapter, Growth, GrowthPoint, Machine};
use scene::Scene;
use std::path::PathBuf;
use std::time::Instant;

/// Charts.
pub(crate) fn run(args: &GrowthArgs) -> Result<(), Stop> {
    report::prepare_dir(&args.out).map_err(Stop::bad)?;
    let mut work = Work::new(args);
    for &triangles in &args.triangles.triangles.0 {
        let begun = Instant::now();
        let spec = format!("{}:{triangles}", args.scene);
        let scene = scene::open(&spec, &scene::Options::default())?;
        work.made.push((
            scene.animation.triangle_count(),
            begun.elapsed().as_secs_f64(),
        ));
        work.size(&spec, &scene);
    }
    let Work { growth, made, .. } = work;
    if growth.points.is_empty() {
        let why = growth.left_out.first().cloned();
        return Err(Stop::bad(
            why.unwrap_or_else(|| "nothing to chart".to_owned()),
        ));
    }
    let files = write(args, &growth)?;
    talk::print(&text(&growth, &made, &files))
}

/// All that is under way.
struct Work<'a> {
    args: &'a GrowthArgs,
    setting: Setting<'a>,
    progress: Progress,
    growth: Growth,
    /// Triangles of each scene, and the seconds that it took to make them.
    made: Vec<(usize, f64)>,
}

impl<'a> Work<'a> {
    fn new(args: &'a GrowthArgs) -> Self {
        let runs = args.triangles.triangles.0.len()
            * args.policies.update.len()
            * args.layouts.layout.len();
        Self {
            args,
            setting: args.timing.setting(),
            progress: Progress::new(runs as u64, args.timing.quiet),
            growth: Growth {
                title: format!("Growth of {}", args.scene),
                machine: Machine {
                    cpu: info::cpu_model(),
                    version: env!("CARGO_PKG_VERSION").to_owned(),
                    date: time::OffsetDateTime::now_utc().date().to_string(),
                    adapters: Vec::new(),
                },
                scene: args.scene.clone(),
                size: args.timing.size.size,
                speed: args.speed,
                ..Growth::default()
            },
            made: Vec::new(),
        }
    }

    /// Every policy in every layout at one size. What cannot be had is left out, and remarked: a larger size may
    /// be too much for a device, which says nothing of the others.
    fn size(&mut self, spec: &str, scene: &Scene) {
        let mut build_ms: f64 = 0.0;
        let mut updates = self.args.policies.update.clone();
        // By then it is known how long a first tree takes.
        updates.sort_by_key(|&u| u == UpdateName::TSah);
        for update in updates {
            for &layout in &self.args.layouts.layout {
                let what = format!("{spec} {} {}", name(update), layout_name(layout));
                match self.time(scene, update, layout, build_ms) {
                    Ok(timing) => {
                        build_ms = build_ms.max(timing.build_ms.unwrap_or(0.0));
                        self.add(scene, update, layout, &timing);
                    }
                    Err(stop) => {
                        self.progress.say(&format!("left out: {what}: {stop}"));
                        self.growth.left_out.push(format!("{what}: {stop}"));
                    }
                }
                self.progress.step(&what);
            }
        }
    }

    fn time(
        &self,
        scene: &Scene,
        update: UpdateName,
        layout: LayoutName,
        build_ms: f64,
    ) -> Result<Timing, Stop> {
        let (seconds, longest) = (FOR_ALL * build_ms * 1e-3, self.args.timing.longest_build);
        if update == UpdateName::TSah && seconds > longest {
            return Err(Stop::bad(format!(
                "its tree would take about {seconds:.0} s to build, more than {longest}"
            )));
        }
        let (end, count) = (scene.animation.end(), self.args.timing.frames);
        let frames = timing::ping_pong(end, self.args.speed, count);
        let way = Way {
            update,
            layout,
            builder_threads: None,
        };
        timing::time(&self.setting, &scene.animation, &frames, way)
    }

    fn add(&mut self, scene: &Scene, update: UpdateName, layout: LayoutName, timing: &Timing) {
        let device = &timing.device;
        if self.growth.machine.adapters.is_empty() {
            self.growth.machine.adapters.push(Adapter {
                backend: device.backend.to_owned(),
                adapter: device.adapter.clone(),
                driver: device.driver.clone(),
            });
        }
        let part = |of: fn(DeviceBytes) -> u64| timing.device_bytes.map(of);
        self.growth.points.push(GrowthPoint {
            triangles: scene.animation.triangle_count() as u64,
            update: name(update).to_owned(),
            layout: layout_name(layout),
            frame_ms: Some(timing.frame_ms),
            geometry_ms: timing.geometry_ms,
            trace_ms: timing.trace_ms,
            first_ms: Some(timing.first_ms),
            build_ms: timing.build_ms,
            device_bytes: part(DeviceBytes::total),
            tree_bytes: part(|b| b.tree),
            scratch_bytes: part(|b| b.scratch),
            scene_bytes: part(|b| b.scene),
            frame_bytes: part(|b| b.frames),
            warm_up_s: timing.warm_up.map(Warmed::seconds),
            frames: timing.frames as u64,
            cut_short: timing.cut_short,
        });
    }
}

/// The three files.
fn write(args: &GrowthArgs, growth: &Growth) -> Result<Vec<PathBuf>, Stop> {
    write_texts(
        &args.out,
        [
            ("growth.svg", chart::growth_svg(growth)),
            ("growth.csv", chart::growth_csv(growth)),
            ("growth.json", chart::growth_json(growth)),
        ],
    )
}

/// Milliseconds a frame, bytes a triangle and where the time went, in Markdown.
fn text(growth: &Growth, made: &[(usize, f64)], files: &[PathBuf]) -> String {
    let mut text = "Milliseconds a frame; > where the run was cut short\n\n".to_owned();
    text += &curves(growth, made, |p| {
        let more = if p.cut_short { "> " } else { "" };
        p.frame_ms.map(|ms| format!("{more}{ms:.3}"))
    });
    text += "\nBytes of device memory a triangle: tree and records + room to make trees + key frames and positions + rays, hits and the like\n\n";
    text += &curves(growth, made, |p| {
        let parts = [p.tree_bytes, p.scratch_bytes, p.scene_bytes, p.frame_bytes];
        let parts = parts.map(|part| p.a_triangle(part));
        let told: Vec<_> = parts.iter().flatten().map(|b| format!("{b:.1}")).collect();
        (!told.is_empty()).then(|| told.join(" + "))
    });
    text += "\nWhat takes long: seconds until the first frame is there (its tree), and of generating the scene\n\n";
    text += &curves(growth, made, |p| {
        p.first_ms.map(|ms| format!("{:.2}", ms * 1e-3))
    });
    if !growth.left_out.is_empty() {
        text += "\nLeft out:\n";
        growth
            .left_out
            .iter()
            .for_each(|why| text += &format!("- {why}\n"));
    }
    files
        .iter()
        .for_each(|file| text += &format!("{}\n", file.display()));
    text
}

/// A row for each size, a column for each curve.
fn curves(
    growth: &Growth,
    made: &[(usize, f64)],
    cell: impl Fn(&GrowthPoint) -> Option<String>,
) -> String {
    let mut columns: Vec<(&str, &str)> = Vec::new();
    for p in &growth.points {
        if !columns.contains(&(&p.update, &p.layout)) {
            columns.push((&p.update, &p.layout));
        }
    }
    let mut head = vec!["triangles".to_owned(), "scene, s".to_owned()];
    head.extend(
        columns
            .iter()
            .map(|(update, layout)| format!("{update} {layout}")),
    );
    let row = |&(triangles, seconds): &(usize, f64)| {
        let here = |p: &&GrowthPoint| p.triangles == triangles as u64;
        let of = |column: &(&str, &str)| {
            let mut all = growth.points.iter().filter(here);
            let point = all.find(|p| (&*p.update, &*p.layout) == *column);
            point.and_then(&cell).unwrap_or_else(|| "-".to_owned())
        };
        let mut row = vec![grouped(triangles), format!("{seconds:.1}")];
        row.extend(columns.iter().map(of));
        row
    };
    let rows: Vec<_> = made.iter().map(row).collect();
    markdown(&head, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_size_has_its_row_and_each_curve_its_column() {
        let point = |triangles, update: &str, frame_ms, cut_short| GrowthPoint {
            triangles,
            update: update.to_owned(),
            layout: "fast".to_owned(),
            frame_ms: Some(frame_ms),
            first_ms: Some(1500.0),
            device_bytes: Some(90 * triangles),
            tree_bytes: Some(60 * triangles),
            scratch_bytes: Some(0),
            scene_bytes: Some(20 * triangles),
            frame_bytes: Some(10 * triangles),
            cut_short,
            ..GrowthPoint::default()
        };
        let growth = Growth {
            points: vec![
                point(1_000, "async", 1.0, false),
                point(1_000, "t-sah", 2.0, true),
                point(50_000, "async", 4.0, false),
            ],
            left_out: vec!["t-sah at 50000: too long".to_owned()],
            ..Growth::default()
        };
        let text = text(
            &growth,
            &[(1_000, 0.04), (50_000, 3.0)],
            &["growth.svg".into()],
        );
        let squeezed = |s: &str| s.split_whitespace().collect::<Vec<_>>().join(" ");
        for line in [
            "| triangles | scene, s | async fast | t-sah fast |",
            "| 1,000 | 0.0 | 1.000 | > 2.000 |",
            "| 50,000 | 3.0 | 4.000 | - |",
            "| 50,000 | 3.0 | 60.0 + 0.0 + 20.0 + 10.0 | - |",
            "| 50,000 | 3.0 | 1.50 | - |",
            "- t-sah at 50000: too long",
        ] {
            assert!(text.lines().any(|l| squeezed(l) == line), "{line}\n{text}");
        }
    }
}
