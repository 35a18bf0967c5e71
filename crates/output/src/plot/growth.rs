//! How time, memory and start-up grow with the number of triangles: a curve for each update policy in each layout.

use super::Result;
use super::axis::Axis;
use super::data::{Machine, known};
use super::look::{Assigned, GREY, LAYOUT_FILLS, Look, POLICIES, Shape};
use super::page::group;
use super::panel::{Legend, Mark, Panel, Series, page, words};
use plotters::style::RGBColor;

/// All that one chart of growth shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Growth {
    /// Heading.
    pub title: String,
    /// What did the work.
    pub machine: Machine,
    /// Pixels of a frame: width, height.
    pub size: [u32; 2],
    /// What was measured, in any order.
    pub points: Vec<GrowthPoint>,
}

/// One policy in one layout at one size. Times are milliseconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrowthPoint {
    /// Triangles.
    pub triangles: u64,
    /// Name of the update policy; shown by colour and shape.
    pub update: String,
    /// Name of the tree's layout; shown by fill.
    pub layout: String,
    /// Of a frame, by the host's clock.
    pub frame_ms: Option<f64>,
    /// Of the first frame, which waits for the first tree.
    pub first_ms: Option<f64>,
    /// Memory on the device.
    pub device_bytes: Option<u64>,
}

impl GrowthPoint {
    /// Bytes of device memory a triangle.
    fn bytes_per_triangle(&self) -> Option<f64> {
        Some(self.device_bytes? as f64 / self.triangles as f64)
    }
}

/// One quantity over the number of triangles: title, unit, value.
type Quantity = (&'static str, &'static str, fn(&GrowthPoint) -> Option<f64>);

const QUANTITIES: [Quantity; 3] = [
    ("Time of a frame, the median", "milliseconds", |p| {
        p.frame_ms
    }),
    (
        "Device memory, all included",
        "bytes a triangle",
        GrowthPoint::bytes_per_triangle,
    ),
    (
        "Start-up: the first frame with its tree",
        "milliseconds",
        |p| p.first_ms,
    ),
];

/// The chart as an SVG picture, 1000 pixels wide, on white. Equal data give equal bytes.
///
/// # Errors
/// See [`super::ChartError`].
pub fn growth_svg(growth: &Growth) -> Result<String> {
    let [width, height] = growth.size;
    let mut words = words(&growth.machine);
    words.push(format!("frames of {width}x{height}"));
    let updates = POLICIES.assign(growth.points.iter().map(|p| &*p.update));
    let layouts = LAYOUT_FILLS.assign(growth.points.iter().map(|p| &*p.layout));
    page(&growth.title, &words, &[480, 400], |areas| {
        let halves = areas[1].split_evenly((1, 2));
        let areas = [&areas[0], &halves[0], &halves[1]];
        for (quantity, area) in QUANTITIES.iter().zip(areas) {
            let mut series = curves(&growth.points, quantity, &updates, &layouts);
            let values = |axis: usize| {
                let marks = series.iter().flat_map(|s| &s.marks);
                marks.map(move |m| m.at[axis]).collect::<Vec<_>>()
            };
            let panel = Panel {
                title: quantity.0.to_owned(),
                x: Axis::log("triangles", values(0)),
                y: Axis::log(quantity.1, values(1)),
                legend: match quantity.0 == QUANTITIES[0].0 {
                    true => Legend::Beside,
                    false => Legend::None,
                },
            };
            series.extend(legend(&updates, &layouts));
            panel.draw(area, &series)?;
        }
        Ok(())
    })
}

fn look(colour: RGBColor, shape: Shape, fill: f64) -> Look {
    Look {
        colour,
        shape,
        fill,
        radius: 6.0,
    }
}

/// What a logarithmic axis can show of each policy in each layout.
fn curves(
    points: &[GrowthPoint],
    quantity: &Quantity,
    updates: &Assigned<(RGBColor, Shape)>,
    layouts: &Assigned<f64>,
) -> Vec<Series> {
    let mut curves = Vec::new();
    for (update, (colour, shape)) in updates {
        for (layout, fill) in layouts {
            let of = points
                .iter()
                .filter(|p| p.update == *update && p.layout == *layout && p.triangles > 0);
            let mark = |p: &GrowthPoint| {
                let value = known(quantity.2(p)).filter(|&v| v > 0.0)?;
                Some(Mark::new(p.triangles as f64, value))
            };
            let mut marks: Vec<Mark> = of.filter_map(mark).collect();
            marks.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
            curves.push(Series {
                look: Some(look(*colour, *shape, *fill)),
                marks,
                line: Some((*colour, 2)),
                ..Series::default()
            });
        }
    }
    curves
}

fn legend(updates: &Assigned<(RGBColor, Shape)>, layouts: &Assigned<f64>) -> Vec<Series> {
    let mut legend = Vec::new();
    group(&mut legend, "update", updates, |(colour, shape)| {
        look(colour, shape, 1.0)
    });
    group(&mut legend, "layout", layouts, |fill| {
        look(GREY, Shape::CIRCLE, fill)
    });
    legend
}
