//! Measured points in, a chart of speed against accuracy out.
//!
//! The main panel shows milliseconds a frame against wrong answers per million
//! rays, both logarithmic, with a place of their own for points that had none
//! wrong; the step line is the Pareto front. Companions show what one number
//! cannot: errors of `t`, leaks, double hits, wrong shadows, memory, key frames.
//!
//! A [`Growth`] is another chart: how time, memory and start-up grow with a scene, through [`growth_svg`].
//!
//! Nothing is measured here, no file is touched and no backend is known: the
//! caller fills a [`Chart`] and writes [`svg`], [`html`], [`csv()`] and [`json`]
//! where it wants them. Equal charts give equal bytes. No data panics: what is
//! missing, not finite or absurd is left out, and where that hides a point the
//! picture says so.

mod axes;
mod data;
mod error;
mod front;
mod growth;
mod html;
mod keys;
mod label;
mod legend;
mod look;
mod mark;
mod offsets;
mod overlay;
mod page;
mod place;
mod plane;
mod rate;
mod rows;
mod scale;
mod scenes;
mod table;
mod text;

#[cfg(test)]
mod tests;

pub use data::{
    Adapter, Aimed, Chart, Companions, KeyFrameStep, KeyFrames, Leaks, Machine, Point, Scene,
    Spread, TError,
};
pub use error::{ChartError, Result};
pub use growth::{Growth, GrowthPoint, growth_svg};
pub use html::html;
pub use table::{SCHEMA, csv, json};

/// The chart as an SVG picture, 1000 pixels wide, on white.
///
/// # Errors
/// See [`ChartError`].
pub fn svg(chart: &Chart) -> Result<String> {
    Ok(overlay::file(chart, &page::draw(chart)?))
}
