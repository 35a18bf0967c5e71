//! Which colour, shape, fill and size stands for which name.
//!
//! Colours are those of Okabe and Ito (*Color Universal Design*, 2008), which people of every colour vision tell apart.
//! They differ in lightness too, for print in black and white.

use super::Point;
use backend::{Intersector, Policy};
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
/// The shapes of [`Intersector::ALL`], in that order.
const SHAPES: [Shape; Intersector::ALL.len()] = [(3, 0.0), (4, 0.125), CIRCLE, (4, 0.0)];
/// The fills of [`Policy::ALL`], in that order.
const FILLS: [f64; Policy::ALL.len()] = [0.0, 0.4, 1.0, 0.7];
const LAYOUTS: &[(&str, f64)] = &[("fast", 7.5), ("bvh2", 5.0)];

/// Pairs each name with what stands for it.
fn pair<T: Copy, const N: usize>(
    names: [&'static str; N],
    marks: [T; N],
) -> [(&'static str, T); N] {
    std::array::from_fn(|i| (names[i], marks[i]))
}

/// What stands for a name in one of the lists above, or for one that is in none.
fn find<T: Copy>(list: &[(&str, T)], name: &str, other: T) -> T {
    let found = list.iter().find(|(known, _)| *known == name);
    found.map_or(other, |(_, stands)| *stands)
}

/// A mark that stands for these names; one that is in no list leaves its part as it is in [`PLAIN`].
pub(crate) fn of_names([backend, intersector, update, layout]: [&str; 4]) -> Look {
    Look {
        colour: find(BACKENDS, backend, PLAIN.colour),
        shape: find(
            &pair(Intersector::ALL.map(Intersector::name), SHAPES),
            intersector,
            PLAIN.shape,
        ),
        fill: find(
            &pair(Policy::ALL.map(Policy::name), FILLS),
            update,
            PLAIN.fill,
        ),
        radius: find(LAYOUTS, layout, PLAIN.radius),
    }
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
