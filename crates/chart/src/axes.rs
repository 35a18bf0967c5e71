//! A pair of axes with names, titles and a grid: the work of `plotters`.

use crate::error::Result;
use crate::mark::{BAND, Font, GREY, PALE, Place, Rect, Sheet, rect, text};
use crate::scale::Scale;
use crate::text::fit;
use plotters::chart::ChartBuilder;
use plotters::coord::ranged1d::Ranged;
use plotters::style::{Color, TRANSPARENT};

/// Height of the names along an axis, in pixels.
pub(crate) const NAME: i32 = 16;

/// One axis and what it is about, unit included.
pub(crate) struct Axis<'a> {
    pub(crate) scale: &'a Scale,
    pub(crate) title: &'a str,
}

/// Room that the axes take, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub(crate) left: i32,
    pub(crate) bottom: i32,
}

/// Where values stand in the picture.
pub(crate) struct Plot {
    x: Scale,
    y: Scale,
    /// The area within the axes.
    pub(crate) rect: Rect,
}

impl Plot {
    /// Of two values.
    pub(crate) fn at(&self, x: f64, y: f64) -> Place {
        (self.x(self.x.at(x)), self.y(self.y.at(y)))
    }

    /// Of a position on the horizontal axis.
    pub(crate) fn x(&self, position: f64) -> i32 {
        self.x.map(&position, (self.rect.x0, self.rect.x1))
    }

    /// Of a position on the vertical axis.
    pub(crate) fn y(&self, position: f64) -> i32 {
        self.y.map(&position, (self.rect.y1, self.rect.y0))
    }

    /// Of the place for zeros and half the way from there to the first value, on the vertical axis.
    pub(crate) fn rail_y(&self) -> Option<(i32, i32)> {
        let (rail, half) = ends(&self.y)?;
        Some((self.y(rail), self.y(half)))
    }
}

/// The place for zeros and the end of its band.
fn ends(scale: &Scale) -> Option<(f64, f64)> {
    // As much after it as there is before it.
    scale.rail.map(|rail| (rail, 2.0 * rail - scale.range.0))
}

/// Draws the axes of a panel that fills `frame`.
pub(crate) fn axes(
    sheet: &Sheet<'_>,
    frame: Rect,
    x: &Axis<'_>,
    y: &Axis<'_>,
    room: Room,
) -> Result<Plot> {
    let area = sheet.clone().shrink(
        (frame.x0, frame.y0),
        (frame.x1 - frame.x0, frame.y1 - frame.y0),
    );
    let mut chart = ChartBuilder::on(&area)
        .margin_top(8)
        .margin_right(16)
        .x_label_area_size(room.bottom)
        .y_label_area_size(room.left)
        .build_cartesian_2d(x.scale.clone(), y.scale.clone())?;
    let (across, down) = chart.plotting_area().get_pixel_range();
    let plot = Plot {
        x: x.scale.clone(),
        y: y.scale.clone(),
        rect: Rect::new(across.start, down.start, across.end, down.end),
    };
    bands(sheet, &plot)?;
    chart
        .configure_mesh()
        .x_labels(x.scale.ticks.len())
        .y_labels(y.scale.ticks.len())
        .x_desc(x.title)
        .y_desc(y.title)
        .axis_desc_style(Font::new(NAME + 1).style())
        .label_style(Font::new(NAME).style())
        .bold_line_style(PALE.stroke_width(1))
        .light_line_style(TRANSPARENT)
        .axis_style(GREY.stroke_width(1))
        .draw()?;
    Ok(plot)
}

/// Shades the places for zeros, so that nobody takes them for a value of the scale.
fn bands(sheet: &Sheet<'_>, plot: &Plot) -> Result<()> {
    let r = plot.rect;
    if let Some((_, half)) = plot.rail_y() {
        rect(sheet, Rect::new(r.x0, half, r.x1, r.y1), BAND.filled())?;
    }
    if let Some((_, half)) = ends(&plot.x) {
        rect(
            sheet,
            Rect::new(r.x0, r.y0, plot.x(half), r.y1),
            BAND.filled(),
        )?;
    }
    Ok(())
}

/// Words over a panel: what it shows.
pub(crate) fn heading(sheet: &Sheet<'_>, frame: Rect, words: &str) -> Result<()> {
    let words = fit(words, 19, frame.x1 - frame.x0);
    text(
        sheet,
        (frame.x0, frame.y0 + 12),
        &words,
        Font::new(18).bold(),
    )
}

/// A companion: what it shows, how to read it, and its axes below.
pub(crate) fn companion(
    sheet: &Sheet<'_>,
    frame: Rect,
    [title, note]: [&str; 2],
    (x, y): (&Axis<'_>, &Axis<'_>),
    left: i32,
) -> Result<Plot> {
    heading(sheet, frame, title)?;
    let note = fit(note, 14, frame.x1 - frame.x0);
    text(
        sheet,
        (frame.x0, frame.y0 + 35),
        &note,
        Font::new(14).colour(GREY),
    )?;
    let frame = Rect {
        y0: frame.y0 + 46,
        ..frame
    };
    axes(sheet, frame, x, y, Room { left, bottom: 54 })
}
