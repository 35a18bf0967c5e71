//! Lines, words and marks, by the drawing primitives of `plotters`.
//!
//! Every place is in pixels from the picture's upper left corner.

use crate::error::Result;
use crate::look::{Fill, Look, Shape};
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::prelude::SVGBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

/// What is drawn on: the whole picture.
pub(crate) type Sheet<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A place in pixels.
pub(crate) type Place = (i32, i32);

pub(crate) const INK: RGBColor = RGBColor(0x1a, 0x1a, 0x1a);
pub(crate) const GREY: RGBColor = RGBColor(0x70, 0x70, 0x70);
/// The Pareto front: broad and light, so that it is no whisker.
pub(crate) const FRONT: RGBColor = RGBColor(0xb4, 0xb4, 0xb4);
pub(crate) const PALE: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);
pub(crate) const BAND: RGBColor = RGBColor(0xf3, 0xf3, 0xf3);

/// Half the width of a mark.
pub(crate) const RADIUS: i32 = 8;

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rect {
    pub(crate) x0: i32,
    pub(crate) y0: i32,
    pub(crate) x1: i32,
    pub(crate) y1: i32,
}

impl Rect {
    pub(crate) fn new(x0: i32, y0: i32, x1: i32, y1: i32) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// A square around a place.
    pub(crate) fn around((x, y): Place, radius: i32) -> Self {
        Self::new(x - radius, y - radius, x + radius, y + radius)
    }

    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.x0 < other.x1 && other.x0 < self.x1 && self.y0 < other.y1 && other.y0 < self.y1
    }

    pub(crate) fn holds(&self, other: &Self) -> bool {
        self.x0 <= other.x0 && self.y0 <= other.y0 && other.x1 <= self.x1 && other.y1 <= self.y1
    }
}

/// How words look.
#[derive(Clone, Copy)]
pub(crate) struct Font {
    pub(crate) size: i32,
    pub(crate) colour: RGBColor,
    pub(crate) style: FontStyle,
    pub(crate) anchor: HPos,
}

impl Font {
    pub(crate) fn new(size: i32) -> Self {
        Self {
            size,
            colour: INK,
            style: FontStyle::Normal,
            anchor: HPos::Left,
        }
    }

    pub(crate) fn bold(self) -> Self {
        Self {
            style: FontStyle::Bold,
            ..self
        }
    }

    pub(crate) fn colour(self, colour: RGBColor) -> Self {
        Self { colour, ..self }
    }

    pub(crate) fn anchor(self, anchor: HPos) -> Self {
        Self { anchor, ..self }
    }

    /// For `plotters`, whose SVG divides sizes by 1.24.
    pub(crate) fn style(&self) -> TextStyle<'_> {
        let font = ("sans-serif", f64::from(self.size) * 1.24, self.style).into_font();
        TextStyle::from(font)
            .color(&self.colour)
            .pos(Pos::new(self.anchor, VPos::Center))
    }
}

/// One line of text, `at` the middle of its height.
pub(crate) fn text(sheet: &Sheet<'_>, at: Place, words: &str, font: Font) -> Result<()> {
    Ok(sheet.draw(&Text::new(words, at, font.style()))?)
}

pub(crate) fn line(
    sheet: &Sheet<'_>,
    places: &[Place],
    colour: RGBColor,
    width: u32,
) -> Result<()> {
    Ok(sheet.draw(&PathElement::new(
        places.to_vec(),
        colour.stroke_width(width),
    ))?)
}

pub(crate) fn rect(sheet: &Sheet<'_>, r: Rect, style: ShapeStyle) -> Result<()> {
    Ok(sheet.draw(&Rectangle::new([(r.x0, r.y0), (r.x1, r.y1)], style))?)
}

/// An interval, with a stroke across each end that lies within the picture's scale.
pub(crate) fn whisker(sheet: &Sheet<'_>, ends: [Place; 2], colour: RGBColor) -> Result<()> {
    line(sheet, &ends, colour, 2)?;
    let upright = ends[0].0 == ends[1].0;
    for (x, y) in ends {
        let across = if upright {
            [(x - 4, y), (x + 4, y)]
        } else {
            [(x, y - 4), (x, y + 4)]
        };
        line(sheet, &across, colour, 2)?;
    }
    Ok(())
}

/// A mark with a white rim, so that marks on top of each other can be counted.
pub(crate) fn mark(sheet: &Sheet<'_>, at: Place, look: Look, radius: i32) -> Result<()> {
    let Look {
        colour,
        shape,
        fill,
    } = look;
    blot(sheet, at, shape, radius + 2, WHITE)?;
    blot(sheet, at, shape, radius, colour)?;
    if fill != Fill::Solid {
        blot(sheet, at, shape, radius - 3, WHITE)?;
    }
    let (x, y) = at;
    let third = (radius / 3).max(2);
    match fill {
        Fill::Solid | Fill::Open => Ok(()),
        Fill::Dotted => blot(sheet, at, Shape::Circle, third, colour),
        Fill::Crossed => {
            line(
                sheet,
                &[(x - third, y - third), (x + third, y + third)],
                colour,
                2,
            )?;
            line(
                sheet,
                &[(x - third, y + third), (x + third, y - third)],
                colour,
                2,
            )
        }
        Fill::Barred => line(sheet, &[(x - radius, y), (x + radius, y)], colour, 3),
    }
}

/// A filled shape.
fn blot(sheet: &Sheet<'_>, at: Place, shape: Shape, radius: i32, colour: RGBColor) -> Result<()> {
    if shape == Shape::Circle {
        return Ok(sheet.draw(&Circle::new(at, radius, colour.filled()))?);
    }
    // Shapes of about equal area.
    let corner = |&(x, y): &(f64, f64)| {
        let r = f64::from(radius);
        (at.0 + (x * r).round() as i32, at.1 + (y * r).round() as i32)
    };
    let corners: Vec<Place> = outline(shape).iter().map(corner).collect();
    Ok(sheet.draw(&Polygon::new(corners, colour.filled()))?)
}

/// Corners in units of the radius, downwards positive.
fn outline(shape: Shape) -> &'static [(f64, f64)] {
    const A: f64 = 0.35;
    match shape {
        Shape::Circle => &[],
        Shape::Square => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
        Shape::Diamond => &[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)],
        Shape::Up => &[(0.0, -1.25), (1.2, 0.9), (-1.2, 0.9)],
        Shape::Down => &[(0.0, 1.25), (1.2, -0.9), (-1.2, -0.9)],
        Shape::Pentagon => &[
            (0.0, -1.1),
            (1.05, -0.34),
            (0.65, 0.9),
            (-0.65, 0.9),
            (-1.05, -0.34),
        ],
        Shape::Plus => &[
            (-A, -1.1),
            (A, -1.1),
            (A, -A),
            (1.1, -A),
            (1.1, A),
            (A, A),
            (A, 1.1),
            (-A, 1.1),
            (-A, A),
            (-1.1, A),
            (-1.1, -A),
            (-A, -A),
        ],
    }
}
