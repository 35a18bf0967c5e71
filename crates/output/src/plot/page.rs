//! Page of charts: a plot of speed against accuracy for each scene, then hard rays.

use super::mark_style::{GREY, INK, LegendEntry, legend, names, of_names, of_point};
use super::panel::{Axis, LINE, Mark, Panel, WIDTH, font, short};
use super::table::{described, escape, format_count, row};
use super::{Chart, ChartPoint, ChartScene, Machine, Rate, Result};
use plotters::backend::SVGBackend;
use plotters::drawing::IntoDrawingArea;
use plotters::element::Text;
use plotters::style::{FontStyle, WHITE};
use std::fmt::Write as _;

const TITLE: &str = "abvh: speed against accuracy";
/// Height of a scatter plot in pixels.
const SCATTER_HEIGHT: u32 = 540;
/// Height of the panel of hard rays in pixels.
const HARD_RAYS_HEIGHT: u32 = 320;

const STYLE: &str = "body { font: 15px sans-serif; margin: 1em auto; max-width: 1000px; color: #1a1a1a; background: #fff }\n\
    svg { max-width: 100%; height: auto }\n\
    .wide { overflow-x: auto }\n\
    table { border-collapse: collapse; white-space: nowrap }\n\
    th, td { padding: 0.2em 0.6em; border-bottom: 1px solid #ddd; text-align: left }\n";

/// Returns the chart as an SVG picture, 1000 pixels wide, on white. Marks of scatter plots have tooltips.
pub fn svg(chart: &Chart) -> Result<String> {
    let mut panels = scatter_plots(chart);
    panels.extend(hard_rays(chart));
    let machine = machine_lines(&chart.machine);
    let head = 46 + 19 * machine.len() as u32;
    let height = head + panels.iter().map(|p| p.height).sum::<u32>();
    let (mut drawn, mut targets) = (String::new(), String::new());
    {
        let sheet = SVGBackend::with_string(&mut drawn, (WIDTH, height)).into_drawing_area();
        sheet.fill(&WHITE)?;
        let bold = font(24, INK, FontStyle::Bold);
        sheet.draw(&Text::new(TITLE, (14, 12), bold))?;
        for (line, y) in machine.iter().zip((44..).step_by(19)) {
            let font = font(14, GREY, FontStyle::Normal);
            sheet.draw(&Text::new(short(line, LINE), (14, y), font))?;
        }
        let mut rest = sheet.split_vertically(head).1;
        for panel in &panels {
            let (area, below) = rest.split_vertically(panel.height);
            rest = below;
            let places = panel.draw(&area)?;
            let placed = panel.marks.iter().zip(places);
            for (mark, (x, y)) in placed.filter(|(m, _)| !m.about.is_empty()) {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    targets,
                    "<circle cx=\"{x}\" cy=\"{y}\" r=\"9\" fill=\"none\" pointer-events=\"all\"><title>{}</title></circle>",
                    escape(&mark.about),
                );
            }
        }
        sheet.present()?;
    }
    let title = format!(">\n<title>{TITLE}</title>\n");
    let drawn = drawn.replacen(">\n", &title, 1);
    let drawn = drawn.trim_end().trim_end_matches("</svg>");
    Ok(format!("{drawn}{targets}</svg>\n"))
}

/// Returns the lines under the title, which describe the machine and the program.
fn machine_lines(machine: &Machine) -> Vec<String> {
    let cpu = machine.cpu.as_deref().unwrap_or("unknown cpu");
    let (version, date) = (&machine.version, &machine.date);
    let mut lines = vec![format!("{cpu} · abvh {version} · {date}")];
    lines.extend(machine.adapters.iter().map(|a| {
        let driver = if a.driver.is_empty() { "" } else { ", " };
        format!("{}: {}{driver}{}", a.backend, a.adapter, a.driver)
    }));
    lines
}

/// Returns scatter plots of milliseconds per frame and wrong answers. All scenes have the same axes for comparison.
fn scatter_plots(chart: &Chart) -> Vec<Panel> {
    let ms = chart.dots().flat_map(|d| d.ms);
    let wrong = chart.dots().map(|d| d.wrong);
    let axes = [
        Axis::log("milliseconds a frame: median, 5 to 95 %", ms),
        Axis::log(
            "wrong answers per million rays, 95 % interval",
            wrong.flat_map(|r| [r.value, r.low, r.high]),
        ),
    ];
    let scatter_plot = |scene: &ChartScene| scatter_plot(chart, scene, axes.clone());
    chart.scenes.iter().map(scatter_plot).collect()
}

fn scatter_plot(chart: &Chart, scene: &ChartScene, axes: [Axis; 2]) -> Panel {
    let dots = chart.dots_of(&scene.name);
    let marks = dots.iter().map(|dot| Mark {
        at: [dot.ms[0], dot.wrong.value],
        bars: [[dot.ms[1], dot.ms[2]], [dot.wrong.low, dot.wrong.high]],
        style: of_point(dot.point),
        about: described(dot.point),
    });
    let front = chart.front(&scene.name);
    let mut legend = legend(&chart.points);
    legend.push(LegendEntry::heading("Pareto front"));
    legend.extend((1..).zip(&front).map(|(i, dot)| LegendEntry {
        text: format!("{i} {}", dot.point.name()),
        style: Some(of_point(dot.point)),
    }));
    let front = front.iter().map(|dot| [dot.ms[0], dot.wrong.value]);
    Panel {
        title: heading(chart, scene, dots.len()),
        height: SCATTER_HEIGHT,
        axes,
        marks: marks.collect(),
        front: front.collect(),
        legend,
    }
}

/// Returns the heading of a plot, including the number of points that are not drawn.
fn heading(chart: &Chart, scene: &ChartScene, drawn: usize) -> String {
    let (name, [width, height]) = (&scene.name, scene.size);
    let [triangles, frames] = [scene.triangles, scene.frames].map(format_count);
    let about =
        format!("{name}: {triangles} triangles, {width} x {height} pixels, {frames} frames");
    let all = chart.points.iter().filter(|p| p.scene == *name).count();
    match all - drawn {
        0 => about,
        n => format!("{about} ({n} not drawn: no time or no tested rays)"),
    }
}

/// Rates of wrong answers of one family of rays.
struct RayFamily<'a> {
    name: &'a str,
    /// Rate of each point of the chart, if known.
    rates: Vec<Option<Rate>>,
}

/// Returns a panel with one position per family of hard rays, and one mark per backend and intersector. Returns `None`
/// if no point has data. Marks have different horizontal offsets, so that equal values do not overlap.
fn hard_rays(chart: &Chart) -> Option<Panel> {
    let points = &chart.points;
    let aimed = |p: &ChartPoint| Rate::of(p.aimed.wrong, p.aimed.rays);
    let mut families = vec![RayFamily {
        name: "edges and vertices",
        rates: points.iter().map(aimed).collect(),
    }];
    families.extend(chart.families().into_iter().map(|name| {
        let rate = |p: &ChartPoint| {
            let found = p.mixed_range.iter().find(|f| f.family == name)?;
            Rate::of(found.wrong, found.rays)
        };
        let rates = points.iter().map(rate).collect();
        RayFamily { name, rates }
    }));
    let intersectors = names(points, |p| &p.intersector).into_iter();
    let backends = names(points, |p| &p.backend);
    let methods = intersectors.flat_map(|i| backends.iter().map(move |b| (i, *b)));
    let methods: Vec<_> = methods.collect();
    let mut marks = Vec::new();
    for (nth, (intersector, backend)) in methods.iter().enumerate() {
        let shift = 0.8 * ((nth as f64 + 0.5) / methods.len() as f64 - 0.5);
        for (at, family) in families.iter().enumerate() {
            let measured = points.iter().zip(&family.rates);
            let measured =
                measured.filter(|(p, _)| p.backend == *backend && p.intersector == *intersector);
            let rates = measured.filter_map(|(_, &rate)| rate);
            // The highest rate of all measurements.
            let worst = rates.max_by(|a, b| a.value.total_cmp(&b.value));
            marks.extend(worst.map(|rate| Mark {
                at: [at as f64 + shift, rate.value],
                bars: [[0.0; 2], [rate.low, rate.high]],
                style: of_names([backend, intersector, ""]),
                about: String::new(),
            }));
        }
    }
    let rates = marks.iter().map(|m| (m.at[1], m.bars[1]));
    let rates = rates.flat_map(|(value, [low, high])| [low, value, high]);
    let names = families.iter().map(|family| family.name.to_owned());
    let axes = [
        Axis::named("family of rays", names),
        Axis::log("wrong per million", rates),
    ];
    let title = "Hard rays: at edges and vertices of the scene, and in scenes of mixed range";
    (!marks.is_empty()).then(|| Panel {
        title: title.to_owned(),
        height: HARD_RAYS_HEIGHT,
        axes,
        marks,
        front: Vec::new(),
        legend: Vec::new(),
    })
}

/// Returns the chart as one HTML file without external resources. Its content security policy forbids them.
pub fn html(chart: &Chart) -> Result<String> {
    let picture = svg(chart)?;
    let cell = |tag: &str, text: &str| format!("<{tag}>{}</{tag}>", escape(text));
    let head = row(&ChartPoint::default());
    let head: String = head.iter().map(|(name, _)| cell("th", name)).collect();
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{TITLE}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <p>Point at a mark to see its numbers.</p>\n\
         <figure>\n{picture}</figure>\n\
         <h2>All points</h2>\n<p>★: no other point of its scene is at least as fast and as often right, and better in one \
         of the two. Of equal points, only the first is marked.</p>\n\
         <p>Intervals are 95 % score intervals (Wilson 1927), or 3 / rays where no answer was wrong.</p>\n\
         <div class=\"wide\"><table>\n<thead><tr><th></th>{head}</tr></thead>\n<tbody>\n"
    );
    for (i, point) in chart.points.iter().enumerate() {
        let cells = row(point).into_iter();
        let cells: String = cells.map(|(_, text)| cell("td", &text)).collect();
        let star = if chart.is_on_front(i) { "★" } else { "" };
        out += &format!("<tr><td>{star}</td>{cells}</tr>\n");
    }
    out += "</tbody>\n</table></div>\n";
    if !chart.failures.is_empty() {
        let failures = chart.failures.iter().map(ToString::to_string);
        let items: String = failures.map(|text| cell("li", &text) + "\n").collect();
        out += &format!("<h2>Failures</h2>\n<ul>\n{items}</ul>\n");
    }
    Ok(out + "</body>\n</html>\n")
}
