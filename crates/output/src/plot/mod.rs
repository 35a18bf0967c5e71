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

/// What nobody tells apart: a picture that cannot be drawn, or a number that a format does not know.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;
