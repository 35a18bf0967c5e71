//! Charts: measured points in, pictures and tables out.
//!
//! A [`Chart`] shows milliseconds a frame against wrong answers per million rays, both logarithmic, with a place of their
//! own for points that had none wrong. Further panels show hard rays, and leaks and double hits by offset.
//!
//! `plotters` draws. Nothing is measured here and no file is touched. Equal data give equal bytes. No data panics:
//! what is missing, not finite or absurd is left out, and where that hides a point the picture says so.

mod data;
mod look;
mod page;
mod panel;
mod table;
#[cfg(test)]
mod tests;

pub use data::{
    Adapter, Aimed, Chart, FamilyCounts, Leaks, Machine, Point, Rate, Scene, Spread, TError,
};
pub use page::{html, svg};
pub use table::{SCHEMA, count, csv, json, rows};

use plotters::drawing::DrawingAreaErrorKind;

/// Why there is no chart.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChartError {
    /// The picture could not be drawn.
    #[error("cannot draw the chart: {0}")]
    Draw(#[from] DrawingAreaErrorKind<std::io::Error>),
    /// The table of points could not be written.
    #[error("cannot write the points as CSV: {0}")]
    Csv(#[from] csv::Error),
    /// The points could not be written as JSON.
    #[error("cannot write the points as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Shorthand.
pub type Result<T> = std::result::Result<T, ChartError>;
