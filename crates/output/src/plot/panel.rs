//! Pages of panels, each with axes, series of marks and a legend: the work of `plotters`.

use super::Result;
use super::axis::Axis;
use super::data::Machine;
use super::look::{GREY, INK, Look, Shape};
use plotters::backend::{DrawingBackend, SVGBackend};
use plotters::chart::{ChartBuilder, ChartContext, SeriesLabelPosition};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Drawable, EmptyElement, ErrorBar, PathElement, PointCollection, Text};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, TRANSPARENT, TextStyle, WHITE};
use plotters_backend::DrawingErrorKind;
use std::f64::consts::{PI, TAU};
use std::iter::{Once, once};

/// Pixels across a page.
const WIDTH: u32 = 1000;
/// Room for a legend beside a panel.
const LEGEND: u32 = 285;
/// Letters of a title, which nobody cuts to the page's width.
const TITLE: usize = 64;
const LINE: usize = 120;
const ENTRY: usize = 38;

/// A page or a part of it.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Context<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;

/// Marks that look alike, and what the legend calls them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    /// Nothing where another panel's legend says it.
    pub(crate) name: String,
    pub(crate) look: Option<Look>,
    pub(crate) marks: Vec<Mark>,
    /// A line through all marks.
    pub(crate) line: Option<(RGBColor, u32)>,
}

/// A value pair with its intervals.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mark {
    pub(crate) at: [f64; 2],
    /// Intervals of both values, where they are known.
    pub(crate) bars: Option<[[f64; 2]; 2]>,
    /// A letter or two beside the mark.
    pub(crate) words: String,
}

impl Mark {
    pub(crate) fn new(x: f64, y: f64) -> Self {
        Self {
            at: [x, y],
            ..Self::default()
        }
    }
}

/// A pair of axes.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    /// Where the legend is, if there is one.
    pub(crate) legend: Legend,
}

#[derive(Clone, Copy)]
pub(crate) enum Legend {
    None,
    Beside,
    UpperLeft,
}

/// Draws a page: title and words, then rows of these heights, which `draw` fills.
pub(crate) fn page(
    title: &str,
    words: &[String],
    heights: &[u32],
    draw: impl FnOnce(&[Area<'_>]) -> Result<()>,
) -> Result<String> {
    let head = 46 + 19 * words.len() as u32;
    let height = head + heights.iter().sum::<u32>();
    let mut svg = String::new();
    {
        let sheet = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        sheet.fill(&WHITE)?;
        let font = font(24, INK, FontStyle::Bold);
        sheet.draw(&Text::new(short(title, TITLE), (14, 12), font))?;
        for (words, y) in words.iter().zip((44..).step_by(19)) {
            let font = self::font(14, GREY, FontStyle::Normal);
            sheet.draw(&Text::new(short(words, LINE), (14, y), font))?;
        }
        let mut rest = sheet.split_vertically(head).1;
        let mut rows = Vec::new();
        for &height in heights {
            let (row, below) = rest.split_vertically(height);
            rows.push(row);
            rest = below;
        }
        draw(&rows)?;
        sheet.present()?;
    }
    Ok(svg)
}

/// Lines under the title: what did the work.
pub(crate) fn words(machine: &Machine) -> Vec<String> {
    let join = |parts: &[&str], between| {
        let parts: Vec<_> = parts.iter().filter(|p| !p.is_empty()).copied().collect();
        parts.join(between)
    };
    let version = match machine.version.as_str() {
        "" => String::new(),
        version => format!("abvh {version}"),
    };
    let cpu = machine.cpu.as_deref().unwrap_or_default();
    let mut lines = vec![join(&[cpu, &version, &machine.date], " · ")];
    lines.extend(machine.adapters.iter().map(|a| {
        let device = join(&[&a.adapter, &a.driver], ", ");
        format!("{}: {device}", a.backend)
    }));
    lines.retain(|l| !l.is_empty());
    lines
}

impl Panel {
    /// Fills `area`; says at which pixels the marks are, series by series.
    pub(crate) fn draw(&self, area: &Area<'_>, series: &[Series]) -> Result<Vec<(i32, i32)>> {
        let (area, beside) = match self.legend {
            Legend::Beside => area.split_horizontally(WIDTH - LEGEND),
            _ => (area.clone(), area.clone()),
        };
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(14)
            .caption(short(&self.title, LINE), font(15, INK, FontStyle::Bold))
            .x_label_area_size(46)
            .y_label_area_size(84)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .x_desc(self.x.title)
            .y_desc(self.y.title)
            .axis_desc_style(font(14, INK, FontStyle::Normal))
            .label_style(font(13, INK, FontStyle::Normal))
            .bold_line_style(RGBColor(0xdd, 0xdd, 0xdd))
            .light_line_style(TRANSPARENT)
            .axis_style(GREY)
            .draw()?;
        self.draw_series(&mut chart, series)?;
        match self.legend {
            Legend::None => {}
            Legend::UpperLeft => {
                draw_legend(&mut chart, series, SeriesLabelPosition::UpperLeft)?;
            }
            Legend::Beside => {
                let empty = || Axis::named("", []);
                let mut legend = ChartBuilder::on(&beside)
                    .margin_top(24)
                    .build_cartesian_2d(empty(), empty())?;
                draw_legend(&mut legend, series, SeriesLabelPosition::UpperLeft)?;
            }
        }
        let marks = series.iter().flat_map(|s| &s.marks);
        Ok(marks.map(|m| chart.backend_coord(&self.at(m.at))).collect())
    }

    fn at(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    /// Intervals below lines, and those below marks.
    fn draw_series(&self, chart: &mut Context<'_>, series: &[Series]) -> Result<()> {
        for series in series {
            let colour = series.look.map_or(GREY, |l| l.colour).mix(0.5);
            for mark in &series.marks {
                let Some([xs, ys]) = mark.bars else { continue };
                let (x, y) = self.at(mark.at);
                let [x0, x1] = xs.map(|x| self.x.at(x));
                let [y0, y1] = ys.map(|y| self.y.at(y));
                let style = colour.filled();
                if x0 < x1 {
                    chart.draw_series([ErrorBar::new_horizontal(y, x0, x, x1, style, 6)])?;
                }
                if y0 < y1 {
                    chart.draw_series([ErrorBar::new_vertical(x, y0, y, y1, style, 6)])?;
                }
            }
        }
        for series in series {
            let places = series.marks.iter().map(|m| self.at(m.at)).collect();
            if let Some((colour, width)) = series.line {
                chart.draw_series([PathElement::new::<Vec<_>, _>(
                    places,
                    colour.stroke_width(width),
                )])?;
            }
        }
        for series in series {
            let places = || series.marks.iter().map(|m| self.at(m.at));
            let glyph = |look| places().map(move |at| Glyph { at, look });
            chart.draw_series(series.look.into_iter().flat_map(glyph))?;
            let words = series.marks.iter().filter(|m| !m.words.is_empty());
            chart.draw_series(words.map(|m| {
                let font = font(15, INK, FontStyle::Bold);
                EmptyElement::at(self.at(m.at)) + Text::new(m.words.clone(), (9, -17), font)
            }))?;
        }
        Ok(())
    }
}

/// Names of series, each with what stands for it.
fn draw_legend(
    chart: &mut Context<'_>,
    series: &[Series],
    position: SeriesLabelPosition,
) -> Result<()> {
    for series in series.iter().filter(|s| !s.name.is_empty()) {
        let none: [Glyph<(f64, f64)>; 0] = [];
        let entry = chart.draw_series(none)?;
        entry.label(short(&series.name, ENTRY));
        if let Some(look) = series.look {
            entry.legend(move |(x, y)| Glyph {
                at: (x + 8, y),
                look,
            });
        } else if let Some((colour, width)) = series.line {
            let style = colour.stroke_width(width);
            entry.legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
        }
    }
    chart
        .configure_series_labels()
        .position(position)
        .margin(8)
        .legend_area_size(22)
        .label_font(font(12, INK, FontStyle::Normal))
        .background_style(WHITE.mix(0.8))
        .draw()?;
    Ok(())
}

/// A mark with a white rim, so that marks on top of each other can be counted.
struct Glyph<C> {
    at: C,
    look: Look,
}

impl<'a, C> PointCollection<'a, C> for &'a Glyph<C> {
    type Point = &'a C;
    type IntoIter = Once<&'a C>;

    fn point_iter(self) -> Self::IntoIter {
        once(&self.at)
    }
}

impl<C, B: DrawingBackend> Drawable<B> for Glyph<C> {
    fn draw<I: Iterator<Item = (i32, i32)>>(
        &self,
        places: I,
        backend: &mut B,
        _: (u32, u32),
    ) -> std::result::Result<(), DrawingErrorKind<B::ErrorType>> {
        let look = self.look;
        let (inside, edge) = (look.colour.mix(look.fill), look.colour.stroke_width(2));
        for at in places {
            if look.shape.corners == 0 {
                let radius = look.radius.round() as u32;
                backend.draw_circle(at, radius + 2, &WHITE, true)?;
                backend.draw_circle(at, radius, &inside, true)?;
                backend.draw_circle(at, radius, &edge, false)?;
                continue;
            }
            backend.fill_polygon(corners(at, look.shape, look.radius + 2.0), &WHITE)?;
            let corners = corners(at, look.shape, look.radius);
            backend.fill_polygon(corners.clone(), &inside)?;
            backend.draw_path(corners, &edge)?;
        }
        Ok(())
    }
}

/// Of a polygon, from the first to the first; it is as large as a circle of that radius.
fn corners((x, y): (i32, i32), shape: Shape, radius: f64) -> Vec<(i32, i32)> {
    let n = f64::from(shape.corners);
    let radius = radius * (PI / (0.5 * n * (TAU / n).sin())).sqrt();
    let corner = |i| {
        let (sin, cos) = (TAU * (f64::from(i) / n + shape.turn)).sin_cos();
        let whole = |r: f64| r.round() as i32;
        (x + whole(radius * sin), y - whole(radius * cos))
    };
    (0..=shape.corners).map(corner).collect()
}

fn font(size: i32, colour: RGBColor, style: FontStyle) -> TextStyle<'static> {
    // The SVG of `plotters` divides sizes by 1.24.
    let font = ("sans-serif", f64::from(size) * 1.24, style).into_font();
    font.color(&colour)
}

/// So many letters at most, all of them such as XML can hold and one line shows.
pub(crate) fn short(text: &str, most: usize) -> String {
    let mut kept: String = clean(text).chars().take(most).collect();
    if text.chars().nth(most).is_some() {
        kept.pop();
        kept.push('…');
    }
    kept
}

/// What XML cannot hold, or would not show on one line, becomes a replacement character or a space.
pub(crate) fn clean(text: &str) -> String {
    let kept = |c: char| match c {
        '\t' | '\n' | '\r' => ' ',
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
        c => c,
    };
    text.chars().map(kept).collect()
}
