//! Which colour, shape, fill and size stands for which name.
//!
//! Colours are those of Okabe and Ito (*Color Universal Design*, 2008), which people of every colour vision tell apart.
//! They differ in lightness too, for print in black and white.

use super::Point;
use plotters::style::RGBColor;
use std::f64::consts::{PI, TAU};

pub(crate) const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
pub(crate) const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);

/// How one mark looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) colour: RGBColor,
    pub(crate) shape: Shape,
    /// How much of the colour is in its inside: 0 is white.
    pub(crate) fill: f64,
    /// Radius of the circle that covers as much, in pixels.
    pub(crate) radius: f64,
}

/// A regular polygon: corners, none of a circle, and how far it is turned from standing on its lower corner, in turns.
type Shape = (u32, f64);

const CIRCLE: Shape = (0, 0.0);
/// What says nothing: for legends.
pub(crate) const PLAIN: Look = Look {
    colour: GREY,
    shape: CIRCLE,
    fill: 1.0,
    radius: 6.0,
};

impl Look {
    /// Corners of a polygon about a place, from the first to the first.
    pub(crate) fn outline(&self, (x, y): (i32, i32)) -> Vec<(i32, i32)> {
        let (corners, turn) = self.shape;
        let n = f64::from(corners);
        let radius = self.radius * (PI / (0.5 * n * (TAU / n).sin())).sqrt();
        let corner = |i| {
            let (sin, cos) = (TAU * (f64::from(i) / n + turn)).sin_cos();
            let [right, down] = [sin, -cos].map(|r| (radius * r).round() as i32);
            (x + right, y + down)
        };
        (0..=corners).map(corner).collect()
    }

    /// Opaque, so that marks on top of each other can be counted.
    pub(crate) fn inside(&self) -> RGBColor {
        let mix = |c: u8| (255.0 - (255.0 - f64::from(c)) * self.fill).round() as u8;
        RGBColor(mix(self.colour.0), mix(self.colour.1), mix(self.colour.2))
    }
}

const BACKENDS: &[(&str, RGBColor)] = &[
    ("cpu", RGBColor(0, 0, 0)),
    ("vulkan", RGBColor(0xd5, 0x5e, 0x00)),
    ("wgpu", RGBColor(0x56, 0xb4, 0xe9)),
];
/// Colours of names that are not in [`BACKENDS`], such as those of rivals.
const OTHERS: [RGBColor; 5] = [
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0xf0, 0xe4, 0x42),
];
const INTERSECTORS: &[(&str, Shape)] = &[
    ("moller-trumbore", (3, 0.0)),
    ("woop", (4, 0.125)),
    ("watertight", CIRCLE),
    ("exact", (4, 0.0)),
];
const UPDATES: &[(&str, f64)] = &[
    ("rebuild", 0.0),
    ("refit", 0.4),
    ("t-sah", 0.2),
    ("device-rebuild", 0.7),
    ("async", 1.0),
];
const LAYOUTS: &[(&str, f64)] = &[("fast", 7.5), ("bvh2", 5.0)];

/// What stands for a name in one of the lists above, or for one that is in none.
fn find<T: Copy>(list: &[(&str, T)], name: &str, other: T) -> T {
    let found = list.iter().find(|(known, _)| *known == name);
    found.map_or(other, |(_, stands)| *stands)
}

/// A mark that stands for these names; one that is in no list leaves its part as it is in [`PLAIN`].
pub(crate) fn of_names([backend, intersector, update, layout]: [&str; 4]) -> Look {
    Look {
        colour: find(BACKENDS, backend, colour_of_other(backend)),
        shape: find(INTERSECTORS, intersector, PLAIN.shape),
        fill: find(UPDATES, update, PLAIN.fill),
        radius: find(LAYOUTS, layout, PLAIN.radius),
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

pub(crate) fn of_point(point: &Point) -> Look {
    of_names(names_of(point))
}

fn names_of(p: &Point) -> [&str; 4] {
    [&p.backend, &p.intersector, &p.update, &p.layout]
}

/// Each name once, in the order of appearance.
pub(crate) fn names(points: &[Point], of: fn(&Point) -> &String) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for name in points.iter().map(of) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// A line of a legend; a heading has no look.
pub(crate) type Entry = (String, Option<Look>);

/// What colours, shapes, fills and sizes stand for: each name once, in the order of appearance.
pub(crate) fn legend(points: &[Point]) -> Vec<Entry> {
    let mut entries = Vec::new();
    let headings = ["backend", "intersector", "update", "layout"];
    for (part, heading) in headings.into_iter().enumerate() {
        entries.push((heading.to_owned(), None));
        for point in points {
            let mut names = [""; 4];
            names[part] = names_of(point)[part];
            let entry = (names[part].to_owned(), Some(of_names(names)));
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
    }
    entries
}
