//! Companions with one row a method: errors of `t`, wrong shadows, memory.

use crate::axes::{Axis, NAME, Plot, companion};
use crate::data::{Point, known};
use crate::error::Result;
use crate::look::{Fill, Look, Looks};
use crate::mark::{Font, Place, Rect, Sheet, line, mark, rect, text, whisker};
use crate::rate::Rate;
use crate::scale::Scale;
use crate::text::{fit, number};
use plotters::style::{Color, RGBColor};

/// Height of a row, in pixels.
const ROW: i32 = 26;
/// Rows beyond these are left out, and said to be.
const MOST: usize = 16;
/// Half the width of a mark.
const SMALL: i32 = 6;

/// What a panel of rows shows.
pub(crate) struct Rows {
    title: &'static str,
    unit: &'static str,
    note: &'static str,
    scale: Scale,
    rows: Vec<Row>,
    left_out: usize,
}

struct Row {
    name: String,
    look: Look,
    cells: Cells,
}

enum Cells {
    /// Open, dotted and solid marks for median, 99.9 % and worst.
    Three([Option<f64>; 3]),
    /// A mark in its interval.
    Rate(Rate),
    /// A bar from zero.
    Bar(f64),
}

impl Cells {
    fn values(&self) -> Vec<f64> {
        match *self {
            Self::Three(all) => all.into_iter().flatten().collect(),
            Self::Rate(r) => vec![r.value, r.low, r.high],
            Self::Bar(x) => vec![x],
        }
    }
}

/// Errors of `t`.
pub(crate) fn t_errors(points: &[Point], looks: &Looks) -> Option<Rows> {
    let rows = rows(points, looks, by_intersector, |group| {
        let worst = |read: fn(&crate::TError) -> Option<f64>| {
            let all = group.iter().filter_map(|p| p.t_error_ulp.as_ref());
            all.filter_map(|e| known(read(e))).reduce(f64::max)
        };
        let three = [worst(|e| e.median), worst(|e| e.p999), worst(|e| e.worst)];
        three
            .iter()
            .any(Option::is_some)
            .then_some(Cells::Three(three))
    });
    panel(rows, |values| {
        Scale::log(values, 4).with_rail("0").with_free_rail()
    })
    .map(|p| Rows {
        title: "Error of t where the hit is right",
        unit: "units in the last place (f32)",
        note: "open: median · dotted: 99.9 % · solid: worst",
        ..p
    })
}

/// Wrong answers to whether a hit is in shadow.
pub(crate) fn shadows(points: &[Point], looks: &Looks) -> Option<Rows> {
    let rows = rows(points, looks, by_intersector, |group| {
        let all = group
            .iter()
            .filter_map(|p| Rate::of(p.wrong_shadow, p.rays_tested));
        let worst =
            all.max_by(|a, b| a.value.total_cmp(&b.value).then(a.high.total_cmp(&b.high)))?;
        Some(Cells::Rate(worst.per(crate::plane::PER)))
    });
    panel(rows, |values| {
        Scale::log(values, 4).with_rail("none").with_free_rail()
    })
    .map(|p| Rows {
        title: "Wrong shadows",
        unit: "wrong shadows per million rays",
        note: "lines: 95 % interval (for none: 3 in N)",
        ..p
    })
}

/// Memory that a backend held.
pub(crate) fn memory(points: &[Point], looks: &Looks) -> Option<Rows> {
    let rows = rows(points, looks, by_layout, |group| {
        let most = group.iter().filter_map(|p| p.memory_bytes).max()?;
        Some(Cells::Bar(most as f64 / f64::from(1 << 20)))
    });
    panel(rows, |values| Scale::from_zero(values, 5)).map(|p| Rows {
        title: "Memory held",
        unit: "MiB",
        note: "the most of any intersector, update and scene",
        ..p
    })
}

fn by_intersector(p: &Point) -> (String, String) {
    (p.backend.clone(), p.intersector.clone())
}

fn by_layout(p: &Point) -> (String, String) {
    (p.backend.clone(), p.layout.clone())
}

/// One row for each pair of names that knows its cells, in the order of the legend.
fn rows(
    points: &[Point],
    looks: &Looks,
    key: fn(&Point) -> (String, String),
    cells: impl Fn(&[&Point]) -> Option<Cells>,
) -> Vec<Row> {
    let mut keys: Vec<(String, String)> = Vec::new();
    let mut sorted: Vec<&Point> = points.iter().collect();
    sorted.sort_by_key(|p| looks.rank(&p.backend, &p.intersector));
    for name in sorted.into_iter().map(key) {
        if !keys.contains(&name) {
            keys.push(name);
        }
    }
    let row = |names: &(String, String)| {
        let group: Vec<&Point> = points.iter().filter(|p| key(p) == *names).collect();
        Some(Row {
            name: format!("{} {}", names.0, names.1),
            look: looks.of_point(group.first()?),
            cells: cells(&group)?,
        })
    };
    keys.iter().filter_map(row).collect()
}

fn panel(mut rows: Vec<Row>, scale: impl Fn(Vec<f64>) -> Scale) -> Option<Rows> {
    let left_out = rows.len().saturating_sub(MOST);
    rows.truncate(MOST);
    let values = rows.iter().flat_map(|r| r.cells.values()).collect();
    (!rows.is_empty()).then(|| Rows {
        title: "",
        unit: "",
        note: "",
        scale: scale(values),
        rows,
        left_out,
    })
}

impl Rows {
    /// In pixels.
    pub(crate) fn height(&self) -> i32 {
        118 + ROW * self.rows.len() as i32
    }

    pub(crate) fn draw(&self, sheet: &Sheet<'_>, frame: Rect) -> Result<()> {
        let note = match self.left_out {
            0 => self.note.to_owned(),
            n => format!("{} · {n} more in points.csv", self.note),
        };
        let names = self.rows.iter().map(|r| fit(&r.name, NAME, 204));
        let y = Scale::named(names).reversed();
        let x = Axis {
            scale: &self.scale,
            title: self.unit,
        };
        let y = Axis {
            scale: &y,
            title: "",
        };
        let plot = companion(sheet, frame, [self.title, &note], (&x, &y), 216)?;
        for (i, row) in (0..).map(f64::from).zip(&self.rows) {
            row.draw(sheet, &plot, i)?;
        }
        Ok(())
    }
}

impl Row {
    fn draw(&self, sheet: &Sheet<'_>, plot: &Plot, index: f64) -> Result<()> {
        let at = |value| plot.at(value, index);
        let solid = Look {
            fill: Fill::Solid,
            ..self.look
        };
        match self.cells {
            Cells::Three(three) => draw_three(sheet, three.map(|v| v.map(at)), self.look),
            Cells::Rate(rate) => {
                whisker(sheet, [at(rate.low), at(rate.high)], solid.colour)?;
                mark(sheet, at(rate.value), solid, SMALL)
            }
            Cells::Bar(value) => draw_bar(sheet, plot.rect.x0, at(value), value, solid.colour),
        }
    }
}

/// A bar from the axis to `end`, its value beside it.
fn draw_bar(sheet: &Sheet<'_>, left: i32, end: Place, value: f64, colour: RGBColor) -> Result<()> {
    let (x, y) = end;
    rect(sheet, Rect::new(left, y - 8, x, y + 8), colour.filled())?;
    text(sheet, (x + 6, y), &number(value), Font::new(15))
}

fn draw_three(sheet: &Sheet<'_>, places: [Option<Place>; 3], look: Look) -> Result<()> {
    let all: Vec<_> = places.into_iter().flatten().collect();
    line(sheet, &all, look.colour, 2)?;
    // The worst below: where they fall together, the median is seen.
    let fills = [Fill::Open, Fill::Dotted, Fill::Solid];
    for (place, fill) in places.into_iter().zip(fills).rev() {
        if let Some(place) = place {
            mark(sheet, place, Look { fill, ..look }, SMALL)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TError;

    fn values(rows: Option<Rows>) -> Vec<(String, Vec<f64>)> {
        let rows = rows.into_iter().flat_map(|r| r.rows);
        rows.map(|r| (r.name, r.cells.values())).collect()
    }

    #[test]
    fn a_row_shows_the_worst_of_its_points() {
        let point = |worst: f64, wrong_shadow, mib: u64| Point {
            backend: "b".to_owned(),
            layout: "l".to_owned(),
            intersector: "i".to_owned(),
            t_error_ulp: Some(TError {
                median: Some(1.0),
                p999: None,
                worst: Some(worst),
            }),
            rays_tested: 1_000_000,
            wrong_shadow,
            memory_bytes: Some(mib << 20),
            ..Point::default()
        };
        let points = [point(3.0, 5, 7), point(f64::NAN, 9, 2), point(2.0, 0, 3)];
        let looks = Looks::of(&points);
        let t = values(t_errors(&points, &looks));
        assert_eq!(t, [("b i".to_owned(), vec![1.0, 3.0])]);
        assert_eq!(values(shadows(&points, &looks))[0].1[0], 9.0);
        assert_eq!(
            values(memory(&points, &looks)),
            [("b l".to_owned(), vec![7.0])]
        );
        assert!(values(memory(&[Point::default()], &looks)).is_empty());
    }
}
