//! Companions over the tolerance for key frames: how far off, and how fast.

use crate::axes::{Axis, Room, axes, heading};
use crate::data::{KeyFrameStep, KeyFrames, known};
use crate::error::Result;
use crate::label;
use crate::look::{Fill, Look, Shape};
use crate::mark::{Font, GREY, Place, Rect, Sheet, line, mark, text};
use crate::place::{Ground, Wish};
use crate::scale::Scale;
use crate::text::{clean, fit};
use plotters::style::RGBColor;

/// Half the width of a mark.
const SMALL: i32 = 6;

/// What to show over the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Error,
    Time,
}

/// Scenes are told apart by shape and by name; their colours mean no backend.
const SHAPES: [Shape; 6] = [
    Shape::Circle,
    Shape::Square,
    Shape::Up,
    Shape::Diamond,
    Shape::Down,
    Shape::Pentagon,
];
const COLOURS: [RGBColor; 3] = [
    RGBColor(0x1a, 0x1a, 0x1a),
    RGBColor(0xb0, 0x60, 0x00),
    RGBColor(0x60, 0x60, 0xb0),
];

/// One quantity over tolerance, a curve each scene.
pub(crate) struct Keys {
    quantity: Quantity,
    curves: Vec<(String, Vec<Step>)>,
}

struct Step {
    tolerance: f64,
    value: f64,
    key_frames: u64,
}

impl Keys {
    /// `None` if nothing is known.
    pub(crate) fn of(all: &[KeyFrames], quantity: Quantity) -> Option<Self> {
        let curve = |k: &KeyFrames| {
            let mut steps: Vec<_> = k
                .steps
                .iter()
                .filter_map(|s| Step::of(s, quantity))
                .collect();
            steps.sort_by(|a, b| a.tolerance.total_cmp(&b.tolerance));
            (!steps.is_empty()).then(|| (clean(&k.scene), steps))
        };
        let curves: Vec<_> = all.iter().filter_map(curve).collect();
        (!curves.is_empty()).then_some(Self { quantity, curves })
    }

    /// In pixels.
    pub(crate) fn height(&self) -> i32 {
        370
    }

    pub(crate) fn draw(&self, sheet: &Sheet<'_>, frame: Rect) -> Result<()> {
        let (title, unit) = match self.quantity {
            Quantity::Error => (
                "Key frames: tolerance and true error",
                "largest error / scene's diagonal",
            ),
            Quantity::Time => ("Key frames: tolerance and time", "milliseconds a frame"),
        };
        heading(sheet, frame, title)?;
        let note = match self.quantity {
            Quantity::Error => "numbers: key frames kept · grey: error = tolerance",
            Quantity::Time => "numbers: key frames kept",
        };
        text(
            sheet,
            (frame.x0, frame.y0 + 34),
            note,
            Font::new(14).colour(GREY),
        )?;
        let steps = || self.curves.iter().flat_map(|c| &c.1);
        let x = Scale::log(steps().map(|s| s.tolerance), 6);
        let y = Scale::log(steps().map(|s| s.value), 6);
        let y = if steps().any(|s| s.value == 0.0) {
            y.with_rail("0")
        } else {
            y
        };
        let x = Axis {
            scale: &x,
            title: "tolerance / scene's diagonal",
        };
        let y = Axis {
            scale: &y,
            title: unit,
        };
        let frame = Rect {
            y0: frame.y0 + 44,
            ..frame
        };
        let plot = axes(
            sheet,
            frame,
            &x,
            &y,
            Room {
                left: 92,
                bottom: 54,
            },
        )?;
        if self.quantity == Quantity::Error {
            let diagonal: Vec<Place> = steps().map(|s| plot.at(s.tolerance, s.tolerance)).collect();
            let ends = [diagonal.iter().min(), diagonal.iter().max()];
            let ends: Vec<Place> = ends.into_iter().flatten().copied().collect();
            line(sheet, &ends, GREY, 1)?;
        }
        let mut wishes = Vec::new();
        for (i, (name, steps)) in self.curves.iter().enumerate() {
            let look = Look {
                colour: COLOURS[i % COLOURS.len()],
                shape: SHAPES[i % SHAPES.len()],
                fill: Fill::Solid,
            };
            let places: Vec<Place> = steps
                .iter()
                .map(|s| plot.at(s.tolerance, s.value))
                .collect();
            line(sheet, &places, look.colour, 2)?;
            for (step, &at) in steps.iter().zip(&places) {
                mark(sheet, at, look, SMALL)?;
                wishes.push(wish(at, step.key_frames.to_string()));
            }
            if let Some(&at) = places.last() {
                wishes.push(wish(at, fit(name, 15, 200)));
            }
        }
        write(sheet, plot.rect, &wishes)
    }
}

impl Step {
    fn of(step: &KeyFrameStep, quantity: Quantity) -> Option<Self> {
        let value = match quantity {
            Quantity::Error => step.max_error,
            Quantity::Time => step.ms,
        };
        Some(Self {
            tolerance: known(step.tolerance).filter(|&t| t > 0.0)?,
            value: known(value).filter(|&v| v >= 0.0)?,
            key_frames: step.key_frames,
        })
    }
}

fn wish(at: Place, text: String) -> Wish {
    Wish {
        at,
        text,
        size: 15,
        far: true,
    }
}

fn write(sheet: &Sheet<'_>, bounds: Rect, wishes: &[Wish]) -> Result<()> {
    let ground = Ground {
        bounds,
        solid: wishes
            .iter()
            .map(|w| Rect::around(w.at, SMALL + 1))
            .collect(),
        soft: Vec::new(),
    };
    label::write(sheet, &ground, wishes, SMALL).map(drop)
}
