//! Which colour, shape, fill and size stands for which name.
//!
//! Colours are those of Okabe and Ito (*Color Universal Design*, 2008), which people of every colour vision tell apart;
//! the first three differ in lightness too, for print in black and white. Names that the program knows always look the
//! same; others take what is left, in the order of their appearance.

use super::data::Point;
use plotters::style::RGBColor;
use std::f64::consts::{PI, TAU};

pub(crate) const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
pub(crate) const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);
const BLACK: RGBColor = RGBColor(0, 0, 0);
const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);

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

/// What may stand for a name: for those that are known, and for others.
type Palette<T> = (&'static [(&'static str, T)], &'static [T]);

const BACKENDS: Palette<RGBColor> = (
    &[
        ("cpu", BLACK),
        ("vulkan", RGBColor(0xd5, 0x5e, 0x00)),
        ("wgpu", SKY),
    ],
    &[
        GREEN,
        ORANGE,
        RGBColor(0x00, 0x72, 0xb2),
        RGBColor(0xcc, 0x79, 0xa7),
    ],
);
const INTERSECTORS: Palette<Shape> = (
    &[
        ("moller-trumbore", (3, 0.0)),
        ("woop", (4, 0.125)),
        ("watertight", CIRCLE),
        ("exact", (4, 0.0)),
    ],
    &[(3, 0.5), (5, 0.0), (6, 0.0)],
);
const UPDATES: Palette<f64> = (
    &[("rebuild", 0.0), ("refit", 0.4), ("async", 1.0)],
    &[0.2, 0.7],
);
const LAYOUTS: Palette<f64> = (&[("fast", 7.5), ("bvh2", 5.0)], &[9.5, 3.5]);

/// Names in the order of a legend, each with what stands for it.
type Assigned<T> = Vec<(String, T)>;

/// Known names first, each once.
fn assign<'a, T: Copy>(
    (known, spare): Palette<T>,
    names: impl Iterator<Item = &'a str> + Clone,
) -> Assigned<T> {
    let is_named = |(known, _): &&(&str, T)| names.clone().any(|name| name == *known);
    let known = known.iter().filter(is_named);
    let mut all: Assigned<T> = known.map(|&(name, x)| (name.to_owned(), x)).collect();
    let mut spare = spare.iter().cycle();
    for name in names {
        if all.iter().all(|(n, _)| n != name) {
            all.extend(spare.next().map(|&x| (name.to_owned(), x)));
        }
    }
    all
}

/// What stands for each name among some points.
pub(crate) struct Looks {
    pub(crate) backends: Assigned<RGBColor>,
    pub(crate) intersectors: Assigned<Shape>,
    updates: Assigned<f64>,
    layouts: Assigned<f64>,
}

/// A line of a legend; a heading has no look.
pub(crate) type Entry = (String, Option<Look>);

impl Looks {
    pub(crate) fn of(points: &[Point]) -> Self {
        Self {
            backends: assign(BACKENDS, points.iter().map(|p| &*p.backend)),
            intersectors: assign(INTERSECTORS, points.iter().map(|p| &*p.intersector)),
            updates: assign(UPDATES, points.iter().map(|p| &*p.update)),
            layouts: assign(LAYOUTS, points.iter().map(|p| &*p.layout)),
        }
    }

    pub(crate) fn of_point(&self, point: &Point) -> Look {
        fn find<T: Copy>(all: &Assigned<T>, name: &str, other: T) -> T {
            all.iter().find(|(n, _)| n == name).map_or(other, |a| a.1)
        }
        Look {
            colour: find(&self.backends, &point.backend, PLAIN.colour),
            shape: find(&self.intersectors, &point.intersector, PLAIN.shape),
            fill: find(&self.updates, &point.update, PLAIN.fill),
            radius: find(&self.layouts, &point.layout, PLAIN.radius),
        }
    }

    /// What colours, shapes, fills and sizes stand for.
    pub(crate) fn legend(&self) -> Vec<Entry> {
        fn group<T: Copy>(heading: &str, all: &Assigned<T>, look: fn(T) -> Look) -> Vec<Entry> {
            let entries = all.iter().map(|(name, x)| (name.clone(), Some(look(*x))));
            std::iter::once((heading.to_owned(), None))
                .chain(entries)
                .collect()
        }
        [
            group("backend", &self.backends, |colour| Look { colour, ..PLAIN }),
            group("intersector", &self.intersectors, |shape| Look {
                shape,
                ..PLAIN
            }),
            group("update", &self.updates, |fill| Look { fill, ..PLAIN }),
            group("layout", &self.layouts, |radius| Look { radius, ..PLAIN }),
        ]
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_names_look_the_same_whoever_is_beside_them() {
        assert_eq!(
            assign(BACKENDS, ["wgpu"].into_iter()),
            [("wgpu".into(), SKY)]
        );
        let among = assign(BACKENDS, ["new", "newer", "wgpu", "cpu"].into_iter());
        let expected = [
            ("cpu", BLACK),
            ("wgpu", SKY),
            ("new", GREEN),
            ("newer", ORANGE),
        ];
        assert_eq!(among, expected.map(|(n, colour)| (n.to_owned(), colour)));
    }
}
