//! The page of speed against accuracy: a plane for each scene, then what else is known.

use super::Result;
use super::axis::Axis;
use super::data::{Chart, Point, Scene, known};
use super::look::{Assigned, BACKENDS, GREY, INTERSECTORS, LAYOUTS, Look, Shape, UPDATES, find};
use super::panel::{Area, Legend, Mark, Panel, Series, page, words};
use super::rate::Rate;
use super::side::{key_frames, side_panels};
use super::table::{count, described, escape};
use plotters::style::RGBColor;
use std::fmt::Write as _;

/// Rays that wrong answers are counted per.
pub(crate) const PER: f64 = 1e6;
/// Heights of a plane, of a panel of its own row, and of one of two in a row.
const PLANE: u32 = 540;
const WIDE: u32 = 320;
const HALF: u32 = 330;

/// The chart as an SVG picture, 1000 pixels wide, on white. Pointing at a mark of a plane shows its numbers.
///
/// # Errors
/// See [`super::ChartError`].
pub fn svg(chart: &Chart) -> Result<String> {
    let looks = Looks::of(&chart.points);
    let scenes = scenes(chart);
    let side = side_panels(chart, &looks);
    let keys = key_frames(chart);
    let mut heights = vec![PLANE; scenes.len()];
    heights.extend(side.iter().map(|_| WIDE));
    heights.extend(keys.iter().map(|_| HALF).take(1));
    let mut targets = String::new();
    let drawn = page(&chart.title, &words(&chart.machine), &heights, |areas| {
        let (planes, below) = areas.split_at(scenes.len());
        for (scene, area) in scenes.iter().zip(planes) {
            plane(area, chart, scene, &looks, &mut targets)?;
        }
        let (wide, halves) = below.split_at(side.len());
        for ((panel, series), area) in side.iter().zip(wide) {
            panel.draw(area, series)?;
        }
        for area in halves {
            let halves = area.split_evenly((1, keys.len()));
            for ((panel, series), area) in keys.iter().zip(&halves) {
                panel.draw(area, series)?;
            }
        }
        Ok(())
    })?;
    let title = format!(">\n<title>{}</title>\n", escape(&chart.title));
    let drawn = drawn.replacen(">\n", &title, 1);
    let drawn = drawn.trim_end().trim_end_matches("</svg>");
    Ok(format!("{drawn}{targets}</svg>\n"))
}

/// A point that can be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Dot<'a> {
    pub(crate) point: &'a Point,
    /// Its place in [`Chart::points`].
    pub(crate) index: usize,
    ms: f64,
    /// Wrong answers per [`PER`] rays.
    wrong: Rate,
}

impl<'a> Dot<'a> {
    /// `None` if there is no time above zero, or no ray was tested.
    fn of((index, point): (usize, &'a Point)) -> Option<Self> {
        Some(Self {
            index,
            point,
            ms: known(point.ms_per_frame.median).filter(|&ms| ms > 0.0)?,
            wrong: Rate::of(point.wrong, point.rays_tested)?.per(PER),
        })
    }

    fn mark(&self) -> Mark {
        let spread = self.point.ms_per_frame;
        let end = |x| known(x).filter(|&x| x > 0.0).unwrap_or(self.ms);
        let ms = [end(spread.p5).min(self.ms), end(spread.p95).max(self.ms)];
        Mark {
            bars: Some([ms, [self.wrong.low, self.wrong.high]]),
            ..Mark::new(self.ms, self.wrong.value)
        }
    }
}

fn dots<'a>(chart: &'a Chart, scene: &str) -> Vec<Dot<'a>> {
    let all = chart.points.iter().enumerate();
    all.filter(|(_, p)| p.scene == scene)
        .filter_map(Dot::of)
        .collect()
}

/// The Pareto front: points of a scene that no other beats in both speed and accuracy, fastest first. Of equal points
/// only the first is in it.
pub(crate) fn front<'a>(chart: &'a Chart, scene: &str) -> Vec<Dot<'a>> {
    let mut dots = dots(chart, scene);
    dots.sort_by(|a, b| {
        let by_rate = a.wrong.value.total_cmp(&b.wrong.value);
        a.ms.total_cmp(&b.ms).then(by_rate)
    });
    let mut least = f64::INFINITY;
    dots.retain(|dot| {
        let is_better = dot.wrong.value < least;
        least = least.min(dot.wrong.value);
        is_better
    });
    dots
}

/// The scenes that were described, each once, then those that only points name; one without a name if there is none.
fn scenes(chart: &Chart) -> Vec<Scene> {
    let mut scenes: Vec<Scene> = Vec::new();
    let named = chart.points.iter().map(|p| Scene {
        name: p.scene.clone(),
        ..Scene::default()
    });
    for scene in chart.scenes.iter().cloned().chain(named) {
        if scenes.iter().all(|s| s.name != scene.name) {
            scenes.push(scene);
        }
    }
    if scenes.is_empty() {
        scenes.push(Scene::default());
    }
    scenes
}

/// What stands for each name among some points.
pub(crate) struct Looks {
    pub(crate) backends: Assigned<RGBColor>,
    pub(crate) intersectors: Assigned<Shape>,
    updates: Assigned<f64>,
    layouts: Assigned<f64>,
}

impl Looks {
    fn of(points: &[Point]) -> Self {
        Self {
            backends: BACKENDS.assign(points.iter().map(|p| &*p.backend)),
            intersectors: INTERSECTORS.assign(points.iter().map(|p| &*p.intersector)),
            updates: UPDATES.assign(points.iter().map(|p| &*p.update)),
            layouts: LAYOUTS.assign(points.iter().map(|p| &*p.layout)),
        }
    }

    fn of_point(&self, point: &Point) -> Look {
        Look {
            colour: find(&self.backends, &point.backend).unwrap_or(GREY),
            shape: find(&self.intersectors, &point.intersector).unwrap_or(Shape::CIRCLE),
            fill: find(&self.updates, &point.update).unwrap_or(1.0),
            radius: find(&self.layouts, &point.layout).unwrap_or(5.0),
        }
    }

    /// What a legend says of colours, shapes, fills and sizes.
    fn legend(&self) -> Vec<Series> {
        let grey = Look {
            colour: GREY,
            shape: Shape::CIRCLE,
            fill: 1.0,
            radius: 6.0,
        };
        let mut legend = Vec::new();
        let backends = |colour| Look { colour, ..grey };
        group(&mut legend, "backend", &self.backends, backends);
        let intersectors = |shape| Look { shape, ..grey };
        group(&mut legend, "intersector", &self.intersectors, intersectors);
        let updates = |fill| Look { fill, ..grey };
        group(&mut legend, "update", &self.updates, updates);
        let layouts = |radius| Look { radius, ..grey };
        group(&mut legend, "layout", &self.layouts, layouts);
        legend
    }
}

/// Entries of a legend below their heading.
pub(crate) fn group<T: Copy>(
    legend: &mut Vec<Series>,
    heading: &str,
    names: &Assigned<T>,
    look: impl Fn(T) -> Look,
) {
    let entry = |name: &str, look| Series {
        name: name.to_owned(),
        look,
        ..Series::default()
    };
    legend.push(entry(heading, None));
    legend.extend(names.iter().map(|(n, x)| entry(n, Some(look(*x)))));
}

/// Milliseconds a frame against wrong answers of one scene; adds places to point at.
fn plane(
    area: &Area<'_>,
    chart: &Chart,
    scene: &Scene,
    looks: &Looks,
    targets: &mut String,
) -> Result<()> {
    // All scenes share their axes, so that planes can be compared.
    let everywhere = chart.points.iter().enumerate().filter_map(Dot::of);
    let everywhere: Vec<Mark> = everywhere.map(|d| d.mark()).collect();
    let values = |axis: usize| {
        let of = move |m: &Mark| [&[m.at[axis]][..], &m.bars.unwrap_or_default()[axis]].concat();
        everywhere.iter().flat_map(of)
    };
    let dots = dots(chart, &scene.name);
    let panel = Panel {
        title: heading(chart, scene, dots.len()),
        x: Axis::log("milliseconds a frame: median, 5 to 95 %", values(0)),
        y: Axis::log("wrong answers per million rays, 95 % interval", values(1)),
        legend: Legend::Beside,
    };
    let of_dot = |dot: &Dot<'_>| Series {
        look: Some(looks.of_point(dot.point)),
        marks: vec![dot.mark()],
        ..Series::default()
    };
    let mut series: Vec<Series> = dots.iter().map(of_dot).collect();
    series.extend(looks.legend());
    series.extend(front_series(&front(chart, &scene.name), looks));
    let places = panel.draw(area, &series)?;
    for (dot, (x, y)) in dots.iter().zip(places) {
        let words = format!("{}; {}", described(dot.point), dot.point.command);
        // Writing to a string cannot fail.
        let _ = writeln!(
            targets,
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"9\" fill=\"none\" pointer-events=\"all\"><title>{}</title></circle>",
            escape(&words),
        );
    }
    Ok(())
}

/// What a plane is about, and what it does not show.
fn heading(chart: &Chart, scene: &Scene, drawn: usize) -> String {
    let all = chart.points.iter().filter(|p| p.scene == scene.name);
    let all = all.count();
    let mut words = scene.name.clone();
    if scene.triangles > 0 {
        let [width, height] = scene.size;
        let [triangles, frames] = [scene.triangles, scene.frames].map(count);
        words += &format!(": {triangles} triangles, {width} x {height} pixels, {frames} frames");
    }
    match all - drawn {
        _ if all == 0 => words += " (no points)",
        0 => {}
        n => words += &format!(" ({n} without a time or tested rays not drawn)"),
    }
    words
}

/// The front as a line of steps, left of which and below which nothing was measured; its points by number.
fn front_series(front: &[Dot<'_>], looks: &Looks) -> Vec<Series> {
    let mut steps = Vec::new();
    let mut above = f64::INFINITY;
    for dot in front {
        let y = dot.wrong.value;
        steps.extend([Mark::new(dot.ms, above), Mark::new(dot.ms, y)]);
        above = y;
    }
    steps.push(Mark::new(f64::INFINITY, above));
    let line = Series {
        name: "fastest of its accuracy".to_owned(),
        marks: steps,
        line: Some((RGBColor(0xb4, 0xb4, 0xb4), 4)),
        ..Series::default()
    };
    let numbered = (1..).zip(front).map(|(i, dot)| Series {
        name: format!("{i} {}", dot.point.name()),
        look: Some(looks.of_point(dot.point)),
        marks: vec![Mark {
            words: i.to_string(),
            ..Mark::new(dot.ms, dot.wrong.value)
        }],
        line: None,
    });
    std::iter::once(line).chain(numbered).collect()
}
