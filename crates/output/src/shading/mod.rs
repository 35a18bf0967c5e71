//! Hits in, pixels out.
//!
//! [`frame_scene`] finds a camera and a light for a motion that
//! nobody described, and [`shade`] turns what a trace found into 8-bit sRGB.
//! Both are functions of their arguments alone: no clock, no chance, no thread
//! count.

mod colour;
mod light;
mod shade;
mod vector;
mod view;

pub use shade::{Shot, shade};
pub use view::{View, frame_scene};
