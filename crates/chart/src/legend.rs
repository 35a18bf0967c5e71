//! What colour, shape, fill and lines stand for.

use crate::error::Result;
use crate::look::{Fill, Look, Looks, Shape};
use crate::mark::{FRONT, Font, GREY, INK, Place, RADIUS, Sheet, line, mark, text, whisker};
use crate::text::{fit, width};

/// Height of the words, and of a line of them, in pixels.
const SIZE: i32 = 16;
const LINE: i32 = 27;

/// Entries in lines, laid out and ready to be drawn.
pub(crate) struct Legend {
    entries: Vec<(Place, Sign, String)>,
    /// In pixels.
    pub(crate) height: i32,
}

enum Sign {
    /// Words in front of a line.
    Heading,
    Mark(Look),
    Front,
    Frames,
    Interval,
}

impl Legend {
    /// For a picture so many pixels wide.
    pub(crate) fn new(looks: &Looks, left: i32, right: i32) -> Self {
        let grey = |shape, fill| Look {
            colour: GREY,
            shape,
            fill,
        };
        let backends = looks.backends.iter();
        let backends = backends.map(|(n, colour)| {
            let look = Look {
                colour: *colour,
                shape: Shape::Square,
                fill: Fill::Solid,
            };
            (Sign::Mark(look), n.clone())
        });
        let shapes = looks.intersectors.iter();
        let shapes = shapes.map(|(n, shape)| (Sign::Mark(grey(*shape, Fill::Solid)), n.clone()));
        let fills = looks.updates.iter();
        let fills = fills.map(|(n, fill)| (Sign::Mark(grey(Shape::Circle, *fill)), n.clone()));
        let lines = [
            (Sign::Front, "Pareto front"),
            (Sign::Frames, "5 to 95 % of frames"),
            (
                Sign::Interval,
                "95 % interval of the rate (for none: 3 in N)",
            ),
        ];
        let lines = lines
            .into_iter()
            .map(|(sign, words)| (sign, words.to_owned()));
        let mut legend = Self {
            entries: Vec::new(),
            height: 0,
        };
        legend.row("backend", backends.collect(), left, right);
        legend.row("intersector", shapes.collect(), left, right);
        legend.row("update", fills.collect(), left, right);
        legend.row("lines", lines.collect(), left, right);
        legend
    }

    /// Rows of marks, each with a heading.
    pub(crate) fn of_marks(rows: Vec<(&str, Vec<(Look, String)>)>, left: i32, right: i32) -> Self {
        let mut legend = Self {
            entries: Vec::new(),
            height: 0,
        };
        for (name, marks) in rows {
            let marks = marks.into_iter();
            let entries = marks.map(|(look, words)| (Sign::Mark(look), words));
            legend.row(name, entries.collect(), left, right);
        }
        legend
    }

    /// One line, and more where it is full.
    fn row(&mut self, name: &str, entries: Vec<(Sign, String)>, left: i32, right: i32) {
        if entries.is_empty() {
            return;
        }
        let mut y = self.height + LINE / 2;
        self.entries
            .push(((left, y), Sign::Heading, name.to_owned()));
        let first = left + 110;
        let mut x = first;
        for (sign, words) in entries {
            let words = if words.is_empty() {
                "(no name)"
            } else {
                &words
            };
            let words = fit(words, SIZE, right - first - 40);
            let wide = 40 + width(&words, SIZE);
            if x > first && x + wide > right {
                (x, y) = (first, y + LINE);
            }
            self.entries.push(((x, y), sign, words));
            x += wide;
        }
        self.height = y + LINE - LINE / 2;
    }

    /// Draws it with its upper edge at `top`.
    pub(crate) fn draw(&self, sheet: &Sheet<'_>, top: i32) -> Result<()> {
        for ((x, y), sign, words) in &self.entries {
            let (x, y) = (*x, y + top);
            let font = Font::new(SIZE).colour(INK);
            match sign {
                Sign::Heading => {
                    text(sheet, (x, y), words, font.colour(GREY))?;
                    continue;
                }
                Sign::Mark(look) => mark(sheet, (x + 10, y), *look, RADIUS)?,
                Sign::Front => {
                    line(
                        sheet,
                        &[
                            (x - 2, y - 7),
                            (x + 10, y - 7),
                            (x + 10, y + 7),
                            (x + 22, y + 7),
                        ],
                        FRONT,
                        4,
                    )?;
                }
                Sign::Frames => whisker(sheet, [(x - 2, y), (x + 22, y)], GREY)?,
                Sign::Interval => whisker(sheet, [(x + 10, y - 9), (x + 10, y + 9)], GREY)?,
            }
            text(sheet, (x + 28, y), words, font)?;
        }
        Ok(())
    }
}
