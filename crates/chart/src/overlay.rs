//! The finished SVG: what was drawn, words for those who do not see it, and a place to point at for each point.

use crate::data::{Chart, Point};
use crate::page::{Drawn, dots};
use crate::plane::{Dot, PER, Target, front_of};
use crate::rate::Rate;
use crate::text::{count, escape, number};
use std::fmt::Write as _;

/// The picture as a file of its own; pointing at a point shows its numbers, where the viewer can do that.
pub(crate) fn file(chart: &Chart, drawn: &Drawn) -> String {
    let (width, height) = drawn.size;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"img\" aria-labelledby=\"chart-title chart-summary\">\n\
         <title id=\"chart-title\">{}</title>\n<desc id=\"chart-summary\">{}</desc>\n{}",
        escape(&chart.title),
        escape(&summary(chart)),
        body(&drawn.svg),
    );
    for target in &drawn.targets {
        let point = &chart.points[target.index];
        let words = [spoken(point), point.command.clone()]
            .map(|w| escape(&w))
            .join("; ");
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{}><title>{words}</title></circle>", circle(target));
    }
    out.push_str("</svg>\n");
    out
}

/// The picture in bands that a page break does not part; each point can be reached by pointer and keyboard.
pub(crate) fn bands(chart: &Chart, drawn: &Drawn) -> String {
    let (width, _) = drawn.size;
    let mut out = format!(
        "<svg width=\"0\" height=\"0\" aria-hidden=\"true\"><defs><g id=\"drawing\">\n{}</g></defs></svg>\n",
        body(&drawn.svg)
    );
    for &(top, bottom) in &drawn.bands {
        let _ = writeln!(
            out,
            "<svg class=\"band\" viewBox=\"0 {top} {width} {}\" role=\"group\" aria-label=\"{}\">\n\
             <use href=\"#drawing\"/>",
            bottom - top,
            escape(
                if top == 0 {
                    summary(chart)
                } else {
                    chart.title.clone()
                }
                .as_str()
            ),
        );
        for target in drawn
            .targets
            .iter()
            .filter(|t| (top..bottom).contains(&t.at.1))
        {
            let _ = writeln!(
                out,
                "{} class=\"target\" tabindex=\"0\" role=\"button\" data-point=\"{}\" aria-label=\"{}\"/>",
                circle(target),
                target.index,
                escape(&spoken(&chart.points[target.index])),
            );
        }
        out.push_str("</svg>\n");
    }
    out
}

/// The beginning of a place to point at.
fn circle(target: &Target) -> String {
    let (x, y) = target.at;
    format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"12\" fill=\"none\" pointer-events=\"all\"")
}

/// What `plotters` wrote between its outermost tags.
fn body(svg: &str) -> &str {
    let inner = svg.split_once('\n').map_or("", |(_, rest)| rest);
    inner
        .rsplit_once("</svg>")
        .map_or(inner, |(inner, _)| inner)
}

/// A point in a sentence.
fn spoken(point: &Point) -> String {
    let ms = point
        .ms_per_frame
        .median
        .map_or("unknown".to_owned(), number);
    format!(
        "{}, {}: {ms} ms a frame, {} wrong of {} rays",
        point.scene,
        point.name(),
        count(point.wrong),
        count(point.rays_tested),
    )
}

/// What the picture says, in words.
fn summary(chart: &Chart) -> String {
    let dots = dots(chart);
    let mut words = format!(
        "Milliseconds a frame against wrong answers per million rays, {} points.",
        chart.points.len()
    );
    let mut scenes: Vec<&str> = dots.iter().map(|d| &*d.point.scene).collect();
    scenes.sort_unstable();
    scenes.dedup();
    for scene in scenes {
        let here: Vec<Dot<'_>> = dots
            .iter()
            .filter(|d| d.point.scene == scene)
            .copied()
            .collect();
        let front: Vec<String> = front_of(&here).iter().map(|d| told(d)).collect();
        let _ = write!(words, " Pareto front on {scene}: {}.", front.join("; "));
    }
    words
}

fn told(dot: &Dot<'_>) -> String {
    let wrong = match dot.point.wrong {
        0 => format!("none wrong in {} rays", count(dot.point.rays_tested)),
        _ => format!("{} wrong per million", number(dot.wrong.value)),
    };
    format!("{}, {} ms, {wrong}", dot.point.name(), number(dot.ms))
}

/// A rate in words, with its interval.
pub(crate) fn rate_words(wrong: u64, tested: u64) -> String {
    match Rate::of(wrong, tested).map(|r| r.per(PER)) {
        None => "unknown".to_owned(),
        Some(r) if wrong == 0 => format!("0 (at most {})", number(r.high)),
        Some(r) => format!(
            "{} ({} to {})",
            number(r.value),
            number(r.low),
            number(r.high)
        ),
    }
}
