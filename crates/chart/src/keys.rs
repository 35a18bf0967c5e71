//! Companions over the tolerance for key frames: how far off, and how fast.

use crate::axes::{Axis, Plot, companion};
use crate::data::{KeyFrameStep, KeyFrames, known};
use crate::error::Result;
use crate::label;
use crate::look::{Fill, Look, Shape};
use crate::mark::{GREY, Place, Rect, Sheet, line, mark};
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
        let (title, note, unit) = match self.quantity {
            Quantity::Error => (
                "Key frames: true error",
                "numbers: key frames kept · grey: error = tolerance",
                "largest error / diagonal",
            ),
            Quantity::Time => (
                "Key frames: time",
                "numbers: key frames kept",
                "milliseconds a frame",
            ),
        };
        let steps = || self.curves.iter().flat_map(|c| &c.1);
        let x = Scale::log(steps().map(|s| s.tolerance), 6);
        let y = Scale::log(steps().flat_map(|s| [s.value, self.bound(s)]), 6);
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
        let plot = companion(sheet, frame, [title, note], (&x, &y), 92)?;
        if self.quantity == Quantity::Error {
            let diagonal = steps().map(|s| plot.at(s.tolerance, s.tolerance));
            let ends: Vec<Place> = diagonal
                .clone()
                .min()
                .into_iter()
                .chain(diagonal.max())
                .collect();
            line(sheet, &ends, GREY, 1)?;
        }
        self.draw_curves(sheet, &plot)
    }

    /// What the value may be at most, where that is known.
    fn bound(&self, step: &Step) -> f64 {
        match self.quantity {
            Quantity::Error => step.tolerance,
            Quantity::Time => step.value,
        }
    }

    fn draw_curves(&self, sheet: &Sheet<'_>, plot: &Plot) -> Result<()> {
        let (mut names, mut numbers, mut soft) = (Vec::new(), Vec::new(), Vec::new());
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
            soft.extend(places.windows(2).flat_map(|w| along(w[0], w[1])));
            for (step, &at) in steps.iter().zip(&places) {
                mark(sheet, at, look, SMALL)?;
                numbers.push(wish(at, step.key_frames.to_string()));
            }
            // In the middle there is room on both sides.
            names.extend(
                places
                    .get(places.len() / 2)
                    .map(|&at| wish(at, fit(name, 15, 200))),
            );
        }
        let solid = numbers
            .iter()
            .map(|w| Rect::around(w.at, SMALL + 1))
            .collect();
        names.append(&mut numbers);
        let ground = Ground {
            bounds: plot.rect,
            solid,
            soft,
        };
        label::write(sheet, &ground, &names, SMALL).map(drop)
    }
}

/// Small rectangles along a line, for labels to keep off.
fn along(a: Place, b: Place) -> impl Iterator<Item = Rect> {
    (0..=10).map(move |i| Rect::around((a.0 + (b.0 - a.0) * i / 10, a.1 + (b.1 - a.1) * i / 10), 3))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_rise_by_tolerance_and_senseless_ones_are_left_out() {
        let step = |tolerance, max_error, ms| KeyFrameStep {
            tolerance: Some(tolerance),
            key_frames: 3,
            max_error: Some(max_error),
            ms,
        };
        let all = [KeyFrames {
            scene: "s".to_owned(),
            steps: vec![
                step(0.1, 0.05, None),
                step(0.01, 0.0, Some(2.0)),
                step(0.0, 0.0, Some(1.0)),
                step(f64::NAN, 0.1, Some(1.0)),
                step(0.2, f64::INFINITY, Some(-1.0)),
            ],
        }];
        let shown = |quantity| -> Vec<(f64, f64)> {
            let keys = Keys::of(&all, quantity).unwrap();
            let steps = keys.curves[0].1.iter();
            steps.map(|s| (s.tolerance, s.value)).collect()
        };
        assert_eq!(shown(Quantity::Error), [(0.01, 0.0), (0.1, 0.05)]);
        assert_eq!(shown(Quantity::Time), [(0.01, 2.0)]);
        assert!(Keys::of(&[KeyFrames::default()], Quantity::Time).is_none());
    }
}
