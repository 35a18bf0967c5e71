//! Colour, shape and fill of marks.
//!
//! Apart from greys, the colours are those of Okabe and Ito (*Color Universal Design*, 2008), which are distinct for
//! all types of colour vision.

use super::ChartPoint;
use backend::{BackendName, Intersector, Policy};
use plotters::style::RGBColor;
use std::f64::consts::{PI, TAU};

pub(crate) const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
pub(crate) const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);

/// Radius in pixels of a circular mark. Polygons have the same area.
pub(crate) const RADIUS: f64 = 6.0;

/// Appearance of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MarkStyle {
    pub(crate) colour: RGBColor,
    pub(crate) shape: MarkShape,
    /// Weight of the colour in the interior, from 0 (white) to 1.
    pub(crate) fill: f64,
}

/// A regular polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MarkShape {
    /// Number of corners; 0 for a circle.
    pub(crate) corners: u32,
    /// Rotation in turns.
    turn: f64,
}

const fn polygon(corners: u32, turn: f64) -> MarkShape {
    MarkShape { corners, turn }
}

const CIRCLE: MarkShape = polygon(0, 0.0);
/// Neutral appearance, for legends and unknown names.
pub(crate) const PLAIN: MarkStyle = MarkStyle {
    colour: GREY,
    shape: CIRCLE,
    fill: 1.0,
};

impl MarkStyle {
    /// Returns the corners of a polygon around a position. The first corner is repeated at the end.
    pub(crate) fn outline(&self, x: i32, y: i32) -> Vec<(i32, i32)> {
        let MarkShape { corners, turn } = self.shape;
        let n = f64::from(corners);
        let radius = RADIUS * (PI / (0.5 * n * (TAU / n).sin())).sqrt();
        let corner = |i| {
            let (sin, cos) = (TAU * (f64::from(i) / n + turn)).sin_cos();
            let [right, down] = [sin, -cos].map(|r| (radius * r).round() as i32);
            (x + right, y + down)
        };
        (0..=corners).map(corner).collect()
    }

    /// Returns the interior colour. It is opaque, so that overlapping marks can be counted.
    pub(crate) fn inside(&self) -> RGBColor {
        let mix = |c: u8| (255.0 - (255.0 - f64::from(c)) * self.fill).round() as u8;
        RGBColor(mix(self.colour.0), mix(self.colour.1), mix(self.colour.2))
    }
}

/// The colours of [`BackendName::ALL`], in that order.
const COLOURS: [RGBColor; BackendName::ALL.len()] = [
    RGBColor(0, 0, 0),
    RGBColor(0xaa, 0xaa, 0xaa),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0xd5, 0x5e, 0x00),
];
/// Colours of other names, such as those of other ray tracers.
const OTHERS: [RGBColor; 5] = [
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0xf0, 0xe4, 0x42),
];
/// The shapes of [`Intersector::ALL`], in that order.
const SHAPES: [MarkShape; Intersector::ALL.len()] =
    [polygon(3, 0.0), polygon(4, 0.125), CIRCLE, polygon(4, 0.0)];
/// The fills of [`Policy::ALL`], in that order.
const FILLS: [f64; Policy::ALL.len()] = [0.0, 0.4, 1.0, 0.7];

/// Returns the value that corresponds to `name` in a list of names, or `other` for an unknown name.
fn find<T: Copy>(names: &[&str], values: &[T], name: &str, other: T) -> T {
    let index = names.iter().position(|known| *known == name);
    index.map_or(other, |index| values[index])
}

/// Returns the appearance for three names. An unknown intersector or update uses the value of [`PLAIN`]. An unknown
/// backend gets a colour that depends on its name.
pub(crate) fn of_names([backend, intersector, update]: [&str; 3]) -> MarkStyle {
    MarkStyle {
        colour: find(
            &BackendName::ALL.map(BackendName::name),
            &COLOURS,
            backend,
            colour_of_other(backend),
        ),
        shape: find(
            &Intersector::ALL.map(Intersector::name),
            &SHAPES,
            intersector,
            PLAIN.shape,
        ),
        fill: find(&Policy::ALL.map(Policy::name), &FILLS, update, PLAIN.fill),
    }
}

/// Returns a colour that depends on the name alone; grey for no name.
fn colour_of_other(name: &str) -> RGBColor {
    if name.is_empty() {
        return PLAIN.colour;
    }
    let mix = |hash: u32, byte: u8| hash.wrapping_mul(33).wrapping_add(byte.into());
    OTHERS[name.bytes().fold(0, mix) as usize % OTHERS.len()]
}

pub(crate) fn of_point(point: &ChartPoint) -> MarkStyle {
    of_names(names_of(point))
}

fn names_of(p: &ChartPoint) -> [&str; 3] {
    [&p.backend, &p.intersector, &p.update]
}

/// Returns each name once, in order of appearance.
pub(crate) fn names(points: &[ChartPoint], of: fn(&ChartPoint) -> &String) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for name in points.iter().map(of) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// Line of a legend.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LegendEntry {
    pub(crate) text: String,
    /// The mark; `None` for a heading.
    pub(crate) style: Option<MarkStyle>,
}

impl LegendEntry {
    pub(crate) fn heading(text: &str) -> Self {
        let text = text.to_owned();
        Self { text, style: None }
    }
}

/// Returns the legend of colours, shapes and fills: each name once, in order of appearance.
pub(crate) fn legend(points: &[ChartPoint]) -> Vec<LegendEntry> {
    let mut entries = Vec::new();
    let headings = ["backend", "intersector", "update"];
    for (part, heading) in headings.into_iter().enumerate() {
        entries.push(LegendEntry::heading(heading));
        for point in points {
            let mut names = [""; 3];
            names[part] = names_of(point)[part];
            let entry = LegendEntry {
                text: names[part].to_owned(),
                style: Some(of_names(names)),
            };
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
    }
    entries
}
