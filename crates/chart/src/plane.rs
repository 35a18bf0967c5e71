//! The main panel: milliseconds a frame against wrong answers, one scene.

use crate::axes::{Axis, NAME, Plot, Room, axes};
use crate::data::{Point, known};
use crate::error::Result;
use crate::front::front;
use crate::label;
use crate::look::Looks;
use crate::mark::{FRONT, Font, Place, RADIUS, Rect, Sheet, line, mark, text, whisker};
use crate::place::{Ground, Wish};
use crate::rate::Rate;
use crate::scale::Scale;
use crate::text::{clean, short_count};
use plotters::style::RGBColor;
use plotters::style::text_anchor::HPos;

/// Rays that wrong answers are counted per.
pub(crate) const PER: f64 = 1e6;

/// A point that can be drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dot<'a> {
    /// Its place in [`crate::Chart::points`].
    pub(crate) index: usize,
    pub(crate) point: &'a Point,
    /// Median time.
    pub(crate) ms: f64,
    /// Wrong answers per [`PER`] rays.
    pub(crate) wrong: Rate,
}

impl<'a> Dot<'a> {
    /// `None` if there is no time above zero, or no ray was tested.
    pub(crate) fn of(index: usize, point: &'a Point) -> Option<Self> {
        Some(Self {
            index,
            point,
            ms: known(point.ms_per_frame.median).filter(|&ms| ms > 0.0)?,
            wrong: Rate::of(point.wrong, point.rays_tested)?.per(PER),
        })
    }

    /// The interval of its times; the median where an end is unknown or makes no sense.
    fn spread(&self) -> [f64; 2] {
        let Self { ms, .. } = *self;
        let [p5, p95] = [self.point.ms_per_frame.p5, self.point.ms_per_frame.p95].map(known);
        [
            p5.filter(|&x| x > 0.0 && x <= ms).unwrap_or(ms),
            p95.filter(|&x| x >= ms).unwrap_or(ms),
        ]
    }
}

/// Dots on the front, fastest first.
pub(crate) fn front_of<'a, 'b>(dots: &'b [Dot<'a>]) -> Vec<&'b Dot<'a>> {
    let pairs: Vec<_> = dots.iter().map(|d| (d.ms, d.wrong.value)).collect();
    front(&pairs).into_iter().map(|i| &dots[i]).collect()
}

/// The axes that all scenes share, so that panels can be compared.
pub(crate) fn scales(dots: &[Dot<'_>]) -> (Scale, Scale) {
    let times = dots
        .iter()
        .flat_map(|d| d.spread().into_iter().chain([d.ms]));
    let rates = dots
        .iter()
        .flat_map(|d| [d.wrong.value, d.wrong.low, d.wrong.high]);
    (Scale::log(times, 9), Scale::log(rates, 7).with_rail(""))
}

/// Where a point was drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target {
    pub(crate) index: usize,
    pub(crate) at: Place,
}

/// Draws one scene's dots into `frame`; says where they are and how many labels found no room.
pub(crate) fn draw(
    sheet: &Sheet<'_>,
    frame: Rect,
    dots: &[Dot<'_>],
    (x, y): &(Scale, Scale),
    looks: &Looks,
) -> Result<(Vec<Target>, usize)> {
    let x = Axis {
        scale: x,
        title: "milliseconds a frame (median)",
    };
    let y = Axis {
        scale: y,
        title: "wrong answers per million rays",
    };
    let room = Room {
        left: 98,
        bottom: 54,
    };
    let plot = axes(sheet, frame, &x, &y, room)?;
    name_rail(sheet, &plot, dots)?;
    let mut ground = Ground {
        bounds: plot.rect,
        solid: dots
            .iter()
            .map(|d| Rect::around(plot.at(d.ms, d.wrong.value), RADIUS + 1))
            .collect(),
        soft: Vec::new(),
    };
    let front = front_of(dots);
    for stretch in steps(&plot, &front).windows(2) {
        line(sheet, stretch, FRONT, 4)?;
        ground.soft.push(around_line(stretch[0], stretch[1]));
    }
    for dot in dots {
        for ends in whiskers(&plot, dot) {
            whisker(sheet, ends, tint(looks.colour(&dot.point.backend)))?;
            ground.soft.push(around_line(ends[0], ends[1]));
        }
    }
    // The front last, so that nothing hides it.
    let on_front = |d: &Dot<'_>| front.iter().any(|f| f.index == d.index);
    let mut order: Vec<&Dot<'_>> = dots.iter().collect();
    order.sort_by_key(|d| on_front(d));
    for dot in &order {
        mark(
            sheet,
            plot.at(dot.ms, dot.wrong.value),
            looks.of_point(dot.point),
            RADIUS,
        )?;
    }
    order.reverse();
    let left_out = labels(sheet, &plot, &ground, &order, &wording(&front, looks))?;
    let target = |d: &Dot<'_>| Target {
        index: d.index,
        at: plot.at(d.ms, d.wrong.value),
    };
    Ok((dots.iter().map(target).collect(), left_out))
}

/// Names the place for zeros: none in how many rays.
fn name_rail(sheet: &Sheet<'_>, plot: &Plot, dots: &[Dot<'_>]) -> Result<()> {
    let Some((y, _)) = plot.rail_y() else {
        return Ok(());
    };
    let rays = dots
        .iter()
        .filter(|d| d.point.wrong == 0)
        .map(|d| d.point.rays_tested);
    let words = match (rays.clone().min(), rays.max()) {
        (Some(least), Some(most)) if least == most => ["none in".to_owned(), short_count(least)],
        (Some(least), Some(_)) => [
            "none in".to_owned(),
            format!("{} or more", short_count(least)),
        ],
        _ => ["none".to_owned(), String::new()],
    };
    for (i, words) in (0..).zip(&words) {
        let size = if words.len() > 9 { NAME - 3 } else { NAME };
        let at = (plot.rect.x0 - 9, y - 9 + 18 * i);
        text(sheet, at, words, Font::new(size).anchor(HPos::Right))?;
    }
    Ok(())
}

/// The front as a line of steps: left of it and below it nothing was measured.
fn steps(plot: &Plot, front: &[&Dot<'_>]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for dot in front {
        let (x, y) = plot.at(dot.ms, dot.wrong.value);
        let above = places.last().map_or(plot.rect.y0, |p| p.1);
        places.extend([(x, above), (x, y)]);
    }
    if let Some(&(_, y)) = places.last() {
        places.push((plot.rect.x1, y));
    }
    places
}

/// The intervals of time and of wrong answers that are wide enough to be seen.
fn whiskers(plot: &Plot, dot: &Dot<'_>) -> Vec<[Place; 2]> {
    let [p5, p95] = dot.spread();
    let Rate { value, low, high } = dot.wrong;
    let time = [plot.at(p5, value), plot.at(p95, value)];
    let rate = [plot.at(dot.ms, low), plot.at(dot.ms, high)];
    let wide = |[a, b]: &[Place; 2]| (a.0 - b.0).abs() + (a.1 - b.1).abs() > 2 * RADIUS;
    [time, rate].into_iter().filter(wide).collect()
}

/// Half as strong on white, so that marks stand out.
fn tint(RGBColor(r, g, b): RGBColor) -> RGBColor {
    let half = |c: u8| 128 + c / 2;
    RGBColor(half(r), half(g), half(b))
}

fn around_line(a: Place, b: Place) -> Rect {
    let (x0, x1) = (a.0.min(b.0), a.0.max(b.0));
    let (y0, y1) = (a.1.min(b.1), a.1.max(b.1));
    Rect::new(x0 - 2, y0 - 2, x1 + 2, y1 + 2)
}

/// What a label says: on the front the whole name, elsewhere what neither shape nor fill tells; nothing
/// where they tell all.
fn wording(front: &[&Dot<'_>], looks: &Looks) -> impl Fn(&Dot<'_>) -> (String, bool) {
    let on_front: Vec<usize> = front.iter().map(|d| d.index).collect();
    let (backends, layouts) = (looks.backends_differ(), looks.layouts_differ);
    move |dot| {
        let p = dot.point;
        let words = match (on_front.contains(&dot.index), backends, layouts) {
            (true, _, _) => p.name(),
            (false, true, true) => format!("{} {}", p.backend, p.layout),
            (false, true, false) => p.backend.clone(),
            (false, false, true) => p.layout.clone(),
            (false, false, false) => String::new(),
        };
        (clean(&words), on_front.contains(&dot.index))
    }
}

/// Draws labels, and says how many found no room.
fn labels(
    sheet: &Sheet<'_>,
    plot: &Plot,
    ground: &Ground,
    order: &[&Dot<'_>],
    wording: &impl Fn(&Dot<'_>) -> (String, bool),
) -> Result<usize> {
    let wish = |dot: &&Dot<'_>| {
        let (words, on_front) = wording(dot);
        (!words.is_empty()).then(|| Wish {
            at: plot.at(dot.ms, dot.wrong.value),
            text: crate::text::fit(&words, NAME, 320),
            size: if on_front { NAME } else { NAME - 1 },
            far: true,
        })
    };
    let wishes: Vec<Wish> = order.iter().filter_map(wish).collect();
    label::write(sheet, ground, &wishes, RADIUS)
}
