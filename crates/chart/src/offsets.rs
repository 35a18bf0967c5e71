//! Companions over the mesh's offset from the origin: leaks and double hits.

use crate::axes::{Axis, Plot, companion};
use crate::data::{Leaks, Point, known};
use crate::error::Result;
use crate::label;
use crate::look::{Fill, Look, Looks};
use crate::mark::{Place, Rect, Sheet, line, mark};
use crate::place::{Ground, Wish};
use crate::rate::Rate;
use crate::scale::Scale;
use crate::text::{clean, number, short_count};

/// Edge-aimed rays that faults are counted per.
const PER: f64 = 1e9;
/// Half the width of a mark.
const SMALL: i32 = 6;

/// What to count of the rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    Leak,
    DoubleHit,
}

impl Fault {
    /// How many there are, of how many rays.
    fn of(self, leaks: &Leaks) -> (u64, u64) {
        match self {
            Self::Leak => (leaks.leaks, leaks.rays),
            Self::DoubleHit => (leaks.double_hits, leaks.counted),
        }
    }
}

/// One kind of fault over offsets, a curve each method.
pub(crate) struct Offsets {
    fault: Fault,
    offsets: Vec<f64>,
    curves: Vec<Curve>,
    /// Least rays of any measurement.
    rays: u64,
}

struct Curve {
    /// The backend, or the intersector where all have the same backend.
    name: String,
    look: Look,
    /// Index of the offset, faults per [`PER`] rays.
    places: Vec<(usize, f64)>,
}

impl Curve {
    /// Whether no fault was seen at any offset.
    fn is_clean(&self) -> bool {
        self.places.iter().all(|p| p.1 == 0.0)
    }
}

impl Offsets {
    /// `None` if no point knows.
    pub(crate) fn of(points: &[Point], looks: &Looks, fault: Fault) -> Option<Self> {
        let all = || points.iter().flat_map(|p| &p.leaks);
        let measured = || all().filter(|l| fault.of(l).1 > 0);
        let mut offsets: Vec<f64> = measured().filter_map(|l| known(l.offset)).collect();
        offsets.sort_by(f64::total_cmp);
        offsets.dedup();
        let mut keys: Vec<_> = points
            .iter()
            .map(|p| {
                (
                    looks.rank(&p.backend, &p.intersector),
                    &p.backend,
                    &p.intersector,
                )
            })
            .collect();
        keys.sort();
        keys.dedup();
        let curve = |&(_, backend, intersector): &(_, &String, &String)| {
            let group = points
                .iter()
                .filter(|p| (&p.backend, &p.intersector) == (backend, intersector));
            let all: Vec<&Leaks> = group.clone().flat_map(|p| &p.leaks).collect();
            Some(Curve {
                name: if looks.backends_differ() {
                    backend.clone()
                } else {
                    intersector.clone()
                },
                look: Look {
                    fill: Fill::Solid,
                    ..looks.of_point(group.clone().next()?)
                },
                places: worst(&all, &offsets, fault),
            })
        };
        let curves = keys
            .iter()
            .filter_map(curve)
            .filter(|c| !c.places.is_empty())
            .collect();
        let rays = measured().map(|l| fault.of(l).1).min()?;
        (!offsets.is_empty()).then_some(Self {
            fault,
            offsets,
            curves,
            rays,
        })
    }

    /// In pixels.
    pub(crate) fn height(&self) -> i32 {
        390
    }

    pub(crate) fn draw(&self, sheet: &Sheet<'_>, frame: Rect) -> Result<()> {
        let (title, unit) = match self.fault {
            Fault::Leak => ("Leaks", "leaks per 10⁹ rays"),
            Fault::DoubleHit => ("Double hits", "double hits per 10⁹ rays"),
        };
        let note = format!(
            "rays aimed at edges and vertices, {} or more",
            short_count(self.rays)
        );
        let rates = self.curves.iter().flat_map(|c| &c.places).map(|p| p.1);
        let x = Scale::named(self.offsets.iter().map(|&o| number_of(o)));
        let y = Scale::log(rates, 6).with_rail("none");
        let x = Axis {
            scale: &x,
            title: "offset of the mesh, in its own sizes",
        };
        let y = Axis {
            scale: &y,
            title: unit,
        };
        let plot = companion(sheet, frame, [title, &note], (&x, &y), 92)?;
        let curves = self.places(&plot);
        for (curve, places) in self.curves.iter().zip(&curves) {
            if !curve.is_clean() {
                line(sheet, places, curve.look.colour, 1)?;
            }
        }
        for (curve, places) in self.curves.iter().zip(&curves) {
            for &at in places {
                mark(sheet, at, curve.look, SMALL)?;
            }
        }
        self.label(sheet, &plot, &curves)
    }

    /// Curves stand side by side within their offset, so that equal ones do not hide each other;
    /// those without any fault among themselves, as they never meet the others.
    fn places(&self, plot: &Plot) -> Vec<Vec<Place>> {
        let clean = self.curves.iter().filter(|c| c.is_clean()).count();
        let mut sides = [0, 0];
        let mut places = Vec::new();
        for curve in &self.curves {
            let side = usize::from(curve.is_clean());
            let beside = [self.curves.len() - clean, clean][side];
            let share = (f64::from(sides[side]) + 0.5) / beside as f64 - 0.5;
            sides[side] += 1;
            let place = |&(offset, rate): &(usize, f64)| {
                (plot.x(offset as f64 + 0.8 * share), plot.at(0.0, rate).1)
            };
            places.push(curve.places.iter().map(place).collect());
        }
        places
    }

    /// Names each curve that is not all on the rail, at its highest point.
    fn label(&self, sheet: &Sheet<'_>, plot: &Plot, curves: &[Vec<Place>]) -> Result<()> {
        let rail = plot.rail_y().map_or(i32::MAX, |r| r.0);
        let wishes: Vec<Wish> = self
            .curves
            .iter()
            .zip(curves)
            .filter_map(|(curve, places)| {
                let at = places
                    .iter()
                    .copied()
                    .filter(|p| p.1 < rail)
                    .min_by_key(|p| p.1)?;
                Some(Wish {
                    at,
                    text: clean(&curve.name),
                    size: 15,
                    far: true,
                })
            })
            .collect();
        let ground = Ground {
            bounds: plot.rect,
            solid: curves
                .iter()
                .flatten()
                .map(|&at| Rect::around(at, SMALL + 1))
                .collect(),
            soft: Vec::new(),
        };
        label::write(sheet, &ground, &wishes, SMALL).map(drop)
    }
}

/// At each offset that was measured, the highest rate among all measurements.
fn worst(all: &[&Leaks], offsets: &[f64], fault: Fault) -> Vec<(usize, f64)> {
    let at = |(index, &offset): (usize, &f64)| {
        let here = all.iter().filter(|l| l.offset == Some(offset));
        let rates = here.filter_map(|l| {
            let (faults, rays) = fault.of(l);
            Some(Rate::of(faults, rays)?.per(PER).value)
        });
        Some((index, rates.reduce(f64::max)?))
    };
    offsets.iter().enumerate().filter_map(at).collect()
}

fn number_of(offset: f64) -> String {
    if offset.fract() == 0.0 && offset.abs() < 1e6 {
        format!("{offset}")
    } else {
        number(offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_of_several_measurements_is_shown() {
        let leaks = |offset, rays, leaks| Leaks {
            offset: Some(offset),
            rays,
            leaks,
            counted: rays / 10,
            double_hits: 7,
        };
        let all = [leaks(0.0, 1000, 1), leaks(0.0, 100, 1), leaks(5.0, 0, 9)];
        let all: Vec<&Leaks> = all.iter().collect();
        assert_eq!(worst(&all, &[0.0, 5.0], Fault::Leak), [(0, 1e7)]);
        assert_eq!(worst(&all, &[0.0, 5.0], Fault::DoubleHit), [(0, 7e8)]);
    }

    #[test]
    fn an_offset_that_no_ray_was_sent_for_is_not_shown() {
        let leaks = |offset, rays| Leaks {
            offset: Some(offset),
            rays,
            ..Leaks::default()
        };
        let point = |leaks| Point {
            leaks,
            ..Point::default()
        };
        let of = |points: &[Point]| Offsets::of(points, &Looks::of(points), Fault::Leak);
        let shown = of(&[
            point(vec![leaks(0.0, 50), leaks(9.0, 0)]),
            point(vec![leaks(3.0, 40)]),
        ]);
        let shown = shown.unwrap();
        assert_eq!((shown.offsets, shown.rays), (vec![0.0, 3.0], 40));
        assert!(of(&[point(vec![leaks(9.0, 0)])]).is_none());
    }
}
