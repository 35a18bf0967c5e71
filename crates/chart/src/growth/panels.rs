//! The picture: milliseconds a frame, bytes a triangle and start-up over the number of triangles, all logarithmic.

use super::{Growth, GrowthPoint};
use crate::axes::{Axis, Plot, companion};
use crate::data::known;
use crate::error::Result;
use crate::legend::Legend;
use crate::look::{Fill, Look, Shape, layout_fills, policies};
use crate::mark::{GREY, Place, Rect, Sheet, line, mark};
use crate::page::{GAP, LEFT, LINE, RIGHT, WIDTH, draw_head, head};
use crate::scale::Scale;
use crate::text::number;
use plotters::prelude::{IntoDrawingArea, SVGBackend};
use plotters::style::{RGBColor, WHITE};

/// Half the width of a mark.
const SMALL: i32 = 6;
/// Heights of the panel over all columns and of those that share a row.
const HEIGHTS: [i32; 2] = [480, 400];

/// One quantity over the number of triangles.
struct Panel {
    title: &'static str,
    note: &'static str,
    unit: &'static str,
    value: fn(&GrowthPoint) -> Option<f64>,
}

const FRAME: Panel = Panel {
    title: "Time of a frame",
    note: "the median",
    unit: "milliseconds",
    value: |p| p.frame_ms,
};
const MEMORY: Panel = Panel {
    title: "Device memory",
    note: "key frames, hits and all else included",
    unit: "bytes a triangle",
    value: GrowthPoint::bytes_per_triangle,
};
const START: Panel = Panel {
    title: "Start-up",
    note: "the first frame, which waits for the first tree",
    unit: "milliseconds",
    value: |p| p.first_ms,
};

/// Points of one policy in one layout.
struct Curve<'a> {
    look: Look,
    points: Vec<&'a GrowthPoint>,
}

/// The chart as an SVG picture, 1000 pixels wide, on white. Equal data give equal bytes.
///
/// # Errors
/// See [`crate::ChartError`].
pub fn growth_svg(growth: &Growth) -> Result<String> {
    let curves = curves(&growth.points);
    let words = words(growth);
    let legend = legend(&growth.points);
    let legend_top = 64 + LINE * words.len() as i32;
    let top = legend_top + legend.height + GAP;
    let [tall, low] = HEIGHTS;
    let second = top + tall + GAP;
    let bottom = second + low + GAP;
    let half = (RIGHT - LEFT - GAP) / 2;
    let frames = [
        (FRAME, Rect::new(LEFT, top, RIGHT, top + tall)),
        (MEMORY, Rect::new(LEFT, second, LEFT + half, second + low)),
        (START, Rect::new(RIGHT - half, second, RIGHT, second + low)),
    ];
    let mut svg = String::new();
    {
        let backend = SVGBackend::with_string(&mut svg, (WIDTH as u32, bottom as u32));
        let sheet = backend.into_drawing_area();
        sheet.fill(&WHITE)?;
        draw_head(&sheet, &growth.title, &words)?;
        legend.draw(&sheet, legend_top)?;
        for (panel, frame) in frames {
            panel.draw(&sheet, frame, &curves)?;
        }
        sheet.present()?;
    }
    Ok(svg)
}

/// Lines under the title.
fn words(growth: &Growth) -> Vec<String> {
    let [width, height] = growth.size;
    let mut words = head(&growth.machine);
    words.push(format!("frames of {width}x{height}"));
    words
}

fn curves(points: &[GrowthPoint]) -> Vec<Curve<'_>> {
    let updates = policies(points.iter().map(|p| &*p.update));
    let layouts = layout_fills(points.iter().map(|p| &*p.layout));
    let mut curves = Vec::new();
    for (update, (colour, shape)) in &updates {
        for (layout, fill) in &layouts {
            let of = |p: &&GrowthPoint| p.update == *update && p.layout == *layout;
            let mut points: Vec<&GrowthPoint> = points.iter().filter(of).collect();
            points.sort_by_key(|p| p.triangles);
            let (colour, shape, fill) = (*colour, *shape, *fill);
            let look = Look {
                colour,
                shape,
                fill,
            };
            curves.push(Curve { look, points });
        }
    }
    curves
}

fn legend(points: &[GrowthPoint]) -> Legend {
    let updates = policies(points.iter().map(|p| &*p.update)).into_iter();
    let entry = |(name, (colour, shape)): (String, (RGBColor, Shape))| {
        let fill = Fill::Solid;
        (
            Look {
                colour,
                shape,
                fill,
            },
            name,
        )
    };
    let layouts = layout_fills(points.iter().map(|p| &*p.layout)).into_iter();
    let fills = layouts.map(|(name, fill)| {
        let (colour, shape) = (GREY, Shape::Circle);
        (
            Look {
                colour,
                shape,
                fill,
            },
            name,
        )
    });
    let rows = [
        ("update", updates.map(entry).collect()),
        ("layout", fills.collect()),
    ];
    Legend::of_marks(rows.into(), LEFT, RIGHT)
}

impl Panel {
    fn draw(&self, sheet: &Sheet<'_>, frame: Rect, curves: &[Curve<'_>]) -> Result<()> {
        let seen: Vec<Vec<(f64, f64)>> = curves.iter().map(|c| self.values(c)).collect();
        let all = || seen.iter().flatten();
        let wide = frame.x1 - frame.x0 > WIDTH / 2;
        let mut x = Scale::log(all().map(|p| p.0), if wide { 9 } else { 5 });
        x.ticks
            .iter_mut()
            .for_each(|t| t.1 = short(10_f64.powf(t.0)));
        let y = Scale::log(all().map(|p| p.1), 8);
        let x = Axis {
            scale: &x,
            title: "triangles",
        };
        let y = Axis {
            scale: &y,
            title: self.unit,
        };
        let plot = companion(sheet, frame, [self.title, self.note], (&x, &y), 92)?;
        for (curve, values) in curves.iter().zip(&seen) {
            draw_curve(sheet, &plot, curve.look, values)?;
        }
        Ok(())
    }

    /// What a logarithmic axis can show.
    fn values(&self, curve: &Curve<'_>) -> Vec<(f64, f64)> {
        let place = |p: &&GrowthPoint| {
            let value = known((self.value)(p)).filter(|&v| v > 0.0)?;
            (p.triangles > 0).then_some((p.triangles as f64, value))
        };
        curve.points.iter().filter_map(place).collect()
    }
}

/// A round number of triangles: `20k`, `1.5M`.
fn short(triangles: f64) -> String {
    let units = [(1e9, "G"), (1e6, "M"), (1e3, "k")];
    let unit = units.iter().find(|u| triangles >= 0.999 * u.0);
    let (unit, name) = *unit.unwrap_or(&(1.0, ""));
    // Two digits are all that an axis names.
    let digits = (triangles / unit * 100.0).round() / 100.0;
    match digits < 1e4 {
        true => format!("{digits}{name}"),
        false => number(triangles),
    }
}

fn draw_curve(sheet: &Sheet<'_>, plot: &Plot, look: Look, values: &[(f64, f64)]) -> Result<()> {
    let places: Vec<Place> = values.iter().map(|&(x, y)| plot.at(x, y)).collect();
    line(sheet, &places, look.colour, 2)?;
    places
        .iter()
        .try_for_each(|&at| mark(sheet, at, look, SMALL))
}
