//! The finished SVG: the picture, words for those who do not see it, and a place to point at for each point.

use crate::data::{Chart, Point};
use crate::page::{Drawn, dots};
use crate::plane::{Dot, PER, Target, front_of};
use crate::rate::Rate;
use crate::text::{count, escape, number};
use std::fmt::Write as _;

/// Whether the picture stands alone or within a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    File,
    Page,
}

/// The picture with its targets.
pub(crate) fn finish(chart: &Chart, drawn: &Drawn, purpose: Use) -> String {
    let (width, height) = drawn.size;
    let size = match purpose {
        Use::File => format!("width=\"{width}\" height=\"{height}\" "),
        Use::Page => String::new(),
    };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" {size}viewBox=\"0 0 {width} {height}\" \
         role=\"group\" aria-labelledby=\"chart-title chart-summary\">\n\
         <title id=\"chart-title\">{}</title>\n<desc id=\"chart-summary\">{}</desc>\n",
        escape(&chart.title),
        escape(&summary(chart)),
    );
    out.push_str(body(&drawn.svg));
    out.push_str("<g class=\"targets\">\n");
    for target in &drawn.targets {
        push_target(&mut out, &chart.points[target.index], target, purpose);
    }
    out.push_str("</g>\n</svg>\n");
    out
}

/// What `plotters` wrote between its outermost tags.
fn body(svg: &str) -> &str {
    let inner = svg.split_once('\n').map_or("", |(_, rest)| rest);
    inner
        .rsplit_once("</svg>")
        .map_or(inner, |(inner, _)| inner)
}

fn push_target(out: &mut String, point: &Point, target: &Target, purpose: Use) {
    let (x, y) = target.at;
    let focus = match purpose {
        Use::File => String::new(),
        Use::Page => format!(
            " class=\"target\" tabindex=\"0\" role=\"button\" data-point=\"{}\" aria-label=\"{}\"",
            target.index,
            escape(&spoken(point)),
        ),
    };
    // Writing to a string cannot fail.
    let _ = write!(
        out,
        "<circle cx=\"{x}\" cy=\"{y}\" r=\"12\" fill=\"none\" pointer-events=\"all\"{focus}>"
    );
    if purpose == Use::File {
        let _ = write!(
            out,
            "<title>{}; {}</title>",
            escape(&spoken(point)),
            escape(&point.command)
        );
    }
    out.push_str("</circle>\n");
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
