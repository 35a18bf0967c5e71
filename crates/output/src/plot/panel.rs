//! Panel with a pair of axes, marks and a legend, drawn by `plotters`.

use super::Result;
use super::mark_style::{GREY, INK, LegendEntry, MarkStyle, RADIUS};
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, EmptyElement, ErrorBar, PathElement, Polygon, Text};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, TRANSPARENT, TextStyle};
use std::ops::Range;

/// Width of the page in pixels.
pub(crate) const WIDTH: u32 = 1000;
/// Width of the legend in pixels.
const LEGEND: u32 = 285;
/// Height of a line of the legend in pixels.
const LEADING: usize = 17;
/// Number of characters that fit across the page.
pub(crate) const LINE: usize = 120;
/// Number of characters that fit across the legend.
const ENTRY: usize = 38;
/// Minimum length of a logarithmic axis in decades.
const LEAST_DECADES: f64 = 1.0;
/// Length in decades below which an axis also labels 2 and 5.
const FEW_DECADES: f64 = 3.5;
/// Maximum length in decades of an axis that labels every decade.
const MOST_DECADES: f64 = 9.0;

/// Drawing area: a page or part of a page.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Axis whose positions are decimal logarithms, or indices of names.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// Title with the unit.
    title: &'static str,
    /// First and last position.
    range: [f64; 2],
    /// Labelled positions.
    ticks: Vec<(f64, String)>,
    /// Position of zero on a logarithmic axis.
    zero: Option<f64>,
}

impl Axis {
    /// Creates a logarithmic axis for the positive `values`, with a position below them for zeros if there are any.
    pub(crate) fn log(title: &'static str, values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut has_zero = false;
        for value in values {
            has_zero |= value == 0.0;
            if value > 0.0 && value.is_finite() {
                (low, high) = (low.min(value.log10()), high.max(value.log10()));
            }
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let padding = (0.5 * (LEAST_DECADES - (high - low))).max(0.04 * (high - low));
        (low, high) = (low - padding, high + padding);
        let mut ticks = log_ticks(low, high);
        let zero = low - 0.08 * (high - low);
        if has_zero {
            ticks.insert(0, (zero, "none".to_owned()));
            low = zero - 0.06 * (high - low);
        }
        Self {
            title,
            range: [low, high],
            ticks,
            zero: Some(zero),
        }
    }

    /// Creates an axis with one position per name, at 0, 1, 2 and so on.
    pub(crate) fn named(title: &'static str, names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<_> = (0..).map(f64::from).zip(names).collect();
        Self {
            title,
            range: [-0.5, ticks.len().max(1) as f64 - 0.5],
            ticks,
            zero: None,
        }
    }

    /// Returns the position of a value, clamped to the range of the axis.
    fn at(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let position = match self.zero {
            Some(_) if value > 0.0 => value.log10(),
            Some(zero) => zero,
            None => value,
        };
        position.clamp(low, high)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, position: &f64, pixels: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range()).map(position, pixels)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let is_bold = !hint.weight().allow_light_points();
        let ticks = self.ticks.iter().filter(|_| is_bold);
        ticks.map(|t| t.0).collect()
    }

    fn range(&self) -> Range<f64> {
        self.range[0]..self.range[1]
    }
}

impl ValueFormatter<f64> for Axis {
    /// Returns the label of a position, or an empty string.
    fn format_ext(&self, position: &f64) -> String {
        let found = self.ticks.iter().find(|t| t.0 == *position);
        found.map_or_else(String::new, |t| t.1.clone())
    }
}

/// Returns the labels of a logarithmic axis. A short axis labels 1, 2 and 5 in each decade, a longer one only 1, and a
/// very long one skips decades.
fn log_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let digits: &[u8] = if high - low < FEW_DECADES {
        &[1, 2, 5]
    } else {
        &[1]
    };
    let step = ((high - low) / MOST_DECADES).ceil().max(1.0) as usize;
    let decades = (low.floor() as i32..=high.floor() as i32).step_by(step);
    let ticks = decades.flat_map(|e| digits.iter().map(move |&d| (d, e)));
    let named = ticks.filter_map(|(d, e)| {
        let value: f64 = format!("{d}e{e}").parse().ok()?;
        Some((value.log10(), value.to_string()))
    });
    let within = |t: &(f64, String)| (low..=high).contains(&t.0);
    named.filter(within).collect()
}

/// Mark at a pair of values, with an interval for each value.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    pub(crate) at: [f64; 2],
    pub(crate) bars: [[f64; 2]; 2],
    pub(crate) style: MarkStyle,
    /// Tooltip text, or empty.
    pub(crate) about: String,
}

/// Panel with two axes.
pub(crate) struct Panel {
    pub(crate) title: String,
    /// Height in pixels.
    pub(crate) height: u32,
    pub(crate) axes: [Axis; 2],
    pub(crate) marks: Vec<Mark>,
    /// Points on the Pareto front, which are numbered and joined by a stepped line.
    pub(crate) front: Vec<[f64; 2]>,
    /// Legend to the right of the panel. May be empty.
    pub(crate) legend: Vec<LegendEntry>,
}

impl Panel {
    /// Draws the panel into `area`. Returns the pixel positions of the marks on the page.
    pub(crate) fn draw(&self, area: &Area<'_>) -> Result<Vec<(i32, i32)>> {
        let legend_width = if self.legend.is_empty() { 0 } else { LEGEND };
        let (area, legend) = area.split_horizontally(WIDTH - legend_width);
        self.draw_legend(&legend)?;
        let [x, y] = &self.axes;
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(14)
            .caption(short(&self.title, LINE), font(15, INK, FontStyle::Bold))
            .x_label_area_size(46)
            .y_label_area_size(84)
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .x_desc(x.title)
            .y_desc(y.title)
            .axis_desc_style(font(14, INK, FontStyle::Normal))
            .label_style(font(13, INK, FontStyle::Normal))
            .bold_line_style(RGBColor(0xdd, 0xdd, 0xdd))
            .light_line_style(TRANSPARENT)
            .axis_style(GREY)
            .draw()?;
        let at = |[a, b]: [f64; 2]| (x.at(a), y.at(b));
        for mark in &self.marks {
            let (place, style) = (at(mark.at), mark.style.colour.mix(0.5).filled());
            let [x0, x1] = mark.bars[0].map(|value| x.at(value));
            let [y0, y1] = mark.bars[1].map(|value| y.at(value));
            if x0 < x1 {
                chart
                    .draw_series([ErrorBar::new_horizontal(place.1, x0, place.0, x1, style, 6)])?;
            }
            if y0 < y1 {
                chart.draw_series([ErrorBar::new_vertical(place.0, y0, place.1, y1, style, 6)])?;
            }
        }
        let line = RGBColor(0xb4, 0xb4, 0xb4).stroke_width(4);
        let steps: Vec<_> = steps(&self.front).into_iter().map(at).collect();
        chart.draw_series((!steps.is_empty()).then(|| PathElement::new(steps, line)))?;
        let place = |mark: &Mark| chart.backend_coord(&at(mark.at));
        let places: Vec<_> = self.marks.iter().map(place).collect();
        let (left, top) = area.get_base_pixel();
        for (mark, (x, y)) in self.marks.iter().zip(&places) {
            draw_mark(&area, x - left, y - top, mark.style)?;
        }
        chart.draw_series((1..).zip(&self.front).map(|(i, place)| {
            let words = Text::new(i.to_string(), (9, -17), font(15, INK, FontStyle::Bold));
            EmptyElement::at(at(*place)) + words
        }))?;
        Ok(places)
    }

    fn draw_legend(&self, area: &Area<'_>) -> Result<()> {
        for (entry, y) in self.legend.iter().zip((34..).step_by(LEADING)) {
            if let Some(style) = entry.style {
                draw_mark(area, 16, y + 5, style)?;
            }
            let weight = entry.style.map_or(FontStyle::Bold, |_| FontStyle::Normal);
            let font = font(12, INK, weight);
            area.draw(&Text::new(short(&entry.text, ENTRY), (30, y), font))?;
        }
        Ok(())
    }
}

/// Returns the stepped line through points in ascending order of x. No point is below and to the left of the line.
fn steps(front: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut above = f64::INFINITY;
    let mut steps = Vec::new();
    for &[x, y] in front {
        steps.extend([[x, above], [x, y]]);
        above = y;
    }
    steps.extend(front.last().map(|last| [f64::INFINITY, last[1]]));
    steps
}

/// Draws a filled circle or polygon with its outline around a pixel.
fn draw_mark(area: &Area<'_>, x: i32, y: i32, style: MarkStyle) -> Result<()> {
    let (inside, edge) = (style.inside().filled(), style.colour.stroke_width(2));
    if style.shape.corners == 0 {
        let radius = RADIUS.round() as u32;
        area.draw(&Circle::new((x, y), radius, inside))?;
        area.draw(&Circle::new((x, y), radius, edge))?;
    } else {
        area.draw(&Polygon::new(style.outline(x, y), inside))?;
        area.draw(&PathElement::new(style.outline(x, y), edge))?;
    }
    Ok(())
}

pub(crate) fn font(size: i32, colour: RGBColor, style: FontStyle) -> TextStyle<'static> {
    // The SVG backend of `plotters` divides font sizes by 1.24.
    let font = ("sans-serif", f64::from(size) * 1.24, style).into_font();
    font.color(&colour)
}

/// Truncates text to at most `most` characters, after replacing characters that XML does not allow.
pub(crate) fn short(text: &str, most: usize) -> String {
    let mut kept: String = clean(text).chars().take(most).collect();
    if text.chars().nth(most).is_some() {
        kept.pop();
        kept.push('…');
    }
    kept
}

/// Replaces characters that XML does not allow by replacement characters, and line breaks and tabs by spaces.
pub(crate) fn clean(text: &str) -> String {
    let kept = |c: char| match c {
        '\t' | '\n' | '\r' => ' ',
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
        c => c,
    };
    text.chars().map(kept).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn log_axis_labels_round_values() {
        for (values, names) in [
            (&[0.9, 12.0][..], "1 2 5 10"),
            (&[0.0, 0.001, 999.0], "none 0.001 0.01 0.1 1 10 100 1000"),
            (&[1e-6, 1e-2], "0.000001 0.00001 0.0001 0.001 0.01"),
        ] {
            let axis = Axis::log("", values.iter().copied());
            let ticks: Vec<_> = axis.ticks.iter().map(|t| &*t.1).collect();
            assert_eq!(ticks.join(" "), names);
        }
        let axis = Axis::log("", [1.0, 0.0, 100.0]);
        assert!(axis.range[0] < axis.at(0.0) && axis.at(0.0) < axis.at(1.0) - 0.1);
        assert_eq!(axis.format_ext(&axis.at(0.0)), "none");
    }

    proptest! {
        #[test]
        fn log_axis_accepts_any_values(
            values in prop::collection::vec(any::<f64>(), 0..6)
        ) {
            let axis = Axis::log("", values.clone());
            let [low, high] = axis.range;
            prop_assert!(low < high && (2..=13).contains(&axis.ticks.len()), "{axis:?}");
            for v in values.iter().copied().chain([0.0, f64::NAN, f64::INFINITY]) {
                prop_assert!((low..=high).contains(&axis.at(v)));
            }
        }
    }
}
