//! Which colour, shape and fill stands for which name.
//!
//! Colours are those of Okabe and Ito (*Color Universal Design*, 2008), which
//! people of every colour vision tell apart; the first three differ in lightness
//! too, for print in black and white. Names that the program knows
//! always look the same; others get what is left, in the order of their appearance.

use crate::data::Point;
use plotters::style::RGBColor;

/// How one point looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) colour: RGBColor,
    pub(crate) shape: Shape,
    pub(crate) fill: Fill,
}

/// Stands for an intersector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Circle,
    Square,
    Diamond,
    Up,
    Down,
    Pentagon,
    Plus,
}

/// Stands for an update policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fill {
    Solid,
    Dotted,
    Open,
    Crossed,
    Barred,
}

const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
const VERMILLION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
const BLACK: RGBColor = RGBColor(0, 0, 0);

const COLOURS: Choice<RGBColor> = Choice {
    known: &[
        ("cpu", BLACK),
        ("vulkan", VERMILLION),
        ("wgpu", SKY),
        ("vulkan-rt", PURPLE),
    ],
    spare: &[GREEN, ORANGE, BLUE],
};
const SHAPES: Choice<Shape> = Choice {
    known: &[
        ("moller-trumbore", Shape::Up),
        ("woop", Shape::Square),
        ("watertight", Shape::Circle),
        ("exact", Shape::Diamond),
    ],
    spare: &[Shape::Down, Shape::Pentagon, Shape::Plus],
};
const FILLS: Choice<Fill> = Choice {
    known: &[
        ("rebuild", Fill::Open),
        ("refit", Fill::Dotted),
        ("async", Fill::Solid),
    ],
    spare: &[Fill::Crossed, Fill::Barred],
};

/// Where colours stand for policies.
const POLICIES: Choice<(RGBColor, Shape)> = Choice {
    known: &[
        ("async", (BLUE, Shape::Circle)),
        ("t-sah", (GREEN, Shape::Diamond)),
        ("refit", (ORANGE, Shape::Square)),
        ("device-rebuild", (PURPLE, Shape::Up)),
        ("rebuild", (BLACK, Shape::Down)),
    ],
    spare: &[(VERMILLION, Shape::Pentagon), (SKY, Shape::Plus)],
};
const LAYOUTS: Choice<Fill> = Choice {
    known: &[("fast", Fill::Solid), ("bvh2", Fill::Open)],
    spare: &[Fill::Dotted, Fill::Crossed, Fill::Barred],
};

/// Update policies as a legend lists them, where their colours mean no backend.
pub(crate) fn policies<'a>(
    names: impl Iterator<Item = &'a str> + Clone,
) -> Vec<(String, (RGBColor, Shape))> {
    POLICIES.assign(names)
}

/// Layouts as a legend lists them, where their fills mean no policy.
pub(crate) fn layout_fills<'a>(
    names: impl Iterator<Item = &'a str> + Clone,
) -> Vec<(String, Fill)> {
    LAYOUTS.assign(names)
}

struct Choice<T: 'static> {
    known: &'static [(&'static str, T)],
    spare: &'static [T],
}

impl<T: Copy> Choice<T> {
    /// The names in the order of a legend, known ones first, each with what stands for it.
    fn assign<'a>(&self, names: impl Iterator<Item = &'a str> + Clone) -> Vec<(String, T)> {
        let known = self
            .known
            .iter()
            .filter(|(name, _)| names.clone().any(|n| n == *name));
        let mut all: Vec<(String, T)> = known.map(|&(name, x)| (name.to_owned(), x)).collect();
        let mut spare = self.spare.iter().cycle();
        for name in names {
            if !all.iter().any(|(n, _)| n == name) {
                all.extend(spare.next().map(|&x| (name.to_owned(), x)));
            }
        }
        all
    }
}

/// What stands for each name among some points.
#[derive(Clone, Debug)]
pub(crate) struct Looks {
    pub(crate) backends: Vec<(String, RGBColor)>,
    pub(crate) intersectors: Vec<(String, Shape)>,
    pub(crate) updates: Vec<(String, Fill)>,
    /// Whether points differ in layout, so that labels must name it.
    pub(crate) layouts_differ: bool,
}

impl Looks {
    pub(crate) fn of(points: &[Point]) -> Self {
        Self {
            backends: COLOURS.assign(points.iter().map(|p| &*p.backend)),
            intersectors: SHAPES.assign(points.iter().map(|p| &*p.intersector)),
            updates: FILLS.assign(points.iter().map(|p| &*p.update)),
            layouts_differ: points.windows(2).any(|w| w[0].layout != w[1].layout),
        }
    }

    /// Whether labels must name the backend.
    pub(crate) fn backends_differ(&self) -> bool {
        self.backends.len() > 1
    }

    pub(crate) fn colour(&self, backend: &str) -> RGBColor {
        find(&self.backends, backend).unwrap_or(BLACK)
    }

    pub(crate) fn shape(&self, intersector: &str) -> Shape {
        find(&self.intersectors, intersector).unwrap_or(Shape::Circle)
    }

    /// Where a legend lists two names; for sorting.
    pub(crate) fn rank(&self, backend: &str, intersector: &str) -> (usize, usize) {
        let place = |n: Option<usize>| n.unwrap_or(usize::MAX);
        (
            place(self.intersectors.iter().position(|i| i.0 == intersector)),
            place(self.backends.iter().position(|b| b.0 == backend)),
        )
    }

    pub(crate) fn of_point(&self, point: &Point) -> Look {
        Look {
            colour: self.colour(&point.backend),
            shape: self.shape(&point.intersector),
            fill: find(&self.updates, &point.update).unwrap_or(Fill::Solid),
        }
    }
}

fn find<T: Copy>(all: &[(String, T)], name: &str) -> Option<T> {
    all.iter().find(|(n, _)| n == name).map(|&(_, x)| x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_names_look_the_same_whoever_is_beside_them() {
        let point = |backend: &str| Point {
            backend: backend.to_owned(),
            ..Point::default()
        };
        let alone = Looks::of(&[point("wgpu")]);
        let many: Vec<_> = ["new", "newer", "wgpu", "cpu"].map(point).into();
        let among = Looks::of(&many);
        assert_eq!(alone.colour("wgpu"), SKY);
        assert_eq!(among.colour("wgpu"), SKY);
        assert_eq!(
            (among.colour("new"), among.colour("newer")),
            (GREEN, ORANGE)
        );
        let order: Vec<_> = among.backends.iter().map(|b| &*b.0).collect();
        assert_eq!(order, ["cpu", "wgpu", "new", "newer"]);
    }
}
