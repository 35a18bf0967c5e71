//! Which colour, shape, fill and size stands for which name.
//!
//! Colours are those of Okabe and Ito (*Color Universal Design*, 2008), which
//! people of every colour vision tell apart; the first three differ in lightness
//! too, for print in black and white. Names that the program knows
//! always look the same; others take what is left, in the order of their appearance.

use plotters::style::RGBColor;

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

/// A circle, or a regular polygon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    /// None of a circle.
    pub(crate) corners: u32,
    /// How far it is turned from standing on its base or lower corner, in turns.
    pub(crate) turn: f64,
}

impl Shape {
    pub(crate) const CIRCLE: Self = Self::new(0, 0.0);

    const fn new(corners: u32, turn: f64) -> Self {
        Self { corners, turn }
    }
}

pub(crate) const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
pub(crate) const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);
const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
const VERMILLION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
const BLACK: RGBColor = RGBColor(0, 0, 0);

/// What may stand for a name.
pub(crate) struct Choice<T: 'static> {
    known: &'static [(&'static str, T)],
    spare: &'static [T],
}

pub(crate) const BACKENDS: Choice<RGBColor> = Choice {
    known: &[("cpu", BLACK), ("vulkan", VERMILLION), ("wgpu", SKY)],
    spare: &[GREEN, ORANGE, BLUE, PURPLE],
};
pub(crate) const INTERSECTORS: Choice<Shape> = Choice {
    known: &[
        ("moller-trumbore", Shape::new(3, 0.0)),
        ("woop", Shape::new(4, 0.125)),
        ("watertight", Shape::CIRCLE),
        ("exact", Shape::new(4, 0.0)),
    ],
    spare: &[Shape::new(3, 0.5), Shape::new(5, 0.0), Shape::new(6, 0.0)],
};
pub(crate) const UPDATES: Choice<f64> = Choice {
    known: &[("rebuild", 0.0), ("refit", 0.4), ("async", 1.0)],
    spare: &[0.2, 0.7],
};
pub(crate) const LAYOUTS: Choice<f64> = Choice {
    known: &[("fast", 7.5), ("bvh2", 5.0)],
    spare: &[9.5, 3.5],
};
/// Where colours stand for policies.
pub(crate) const POLICIES: Choice<(RGBColor, Shape)> = Choice {
    known: &[
        ("async", (BLUE, Shape::CIRCLE)),
        ("t-sah", (GREEN, Shape::new(4, 0.0))),
        ("refit", (ORANGE, Shape::new(4, 0.125))),
        ("device-rebuild", (PURPLE, Shape::new(3, 0.0))),
        ("rebuild", (BLACK, Shape::new(3, 0.5))),
    ],
    spare: &[(VERMILLION, Shape::new(5, 0.0)), (SKY, Shape::new(6, 0.0))],
};
/// Where fills stand for layouts.
pub(crate) const LAYOUT_FILLS: Choice<f64> = Choice {
    known: &[("fast", 1.0), ("bvh2", 0.0)],
    spare: &[0.4, 0.7],
};
/// Where colours stand for scenes.
pub(crate) const SCENES: Choice<RGBColor> = Choice {
    known: &[],
    spare: &[BLACK, ORANGE, BLUE, PURPLE, GREEN],
};

/// Names in the order of a legend, each with what stands for it.
pub(crate) type Assigned<T> = Vec<(String, T)>;

impl<T: Copy> Choice<T> {
    /// Known names first, each once.
    pub(crate) fn assign<'a>(&self, names: impl Iterator<Item = &'a str> + Clone) -> Assigned<T> {
        let is_named = |(known, _): &&(&str, T)| names.clone().any(|name| name == *known);
        let known = self.known.iter().filter(is_named);
        let mut all: Assigned<T> = known.map(|&(name, x)| (name.to_owned(), x)).collect();
        let mut spare = self.spare.iter().cycle();
        for name in names {
            if find(&all, name).is_none() {
                all.extend(spare.next().map(|&x| (name.to_owned(), x)));
            }
        }
        all
    }
}

/// What stands for a name.
pub(crate) fn find<T: Copy>(all: &Assigned<T>, name: &str) -> Option<T> {
    all.iter().find(|(n, _)| n == name).map(|&(_, x)| x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_names_look_the_same_whoever_is_beside_them() {
        let alone = BACKENDS.assign(["wgpu"].into_iter());
        let among = BACKENDS.assign(["new", "newer", "wgpu", "cpu"].into_iter());
        assert_eq!(find(&alone, "wgpu"), Some(SKY));
        let expected = [
            ("cpu", BLACK),
            ("wgpu", SKY),
            ("new", GREEN),
            ("newer", ORANGE),
        ];
        assert_eq!(
            among,
            expected.map(|(name, colour)| (name.to_owned(), colour))
        );
    }
}
