//! Whether and where a line meets a triangle, in whole numbers.
//!
//! For the few rays that rounded arithmetic with its error bounds leaves open.
//! Triangles are closed, and a line in a triangle's plane misses it: the
//! contract's `exact`. Every finite `f32` is a whole multiple of a power of
//! two, so each decision is the sign of a sum of products of integers, which
//! are as long as they need to be: no rounding, overflow or underflow.

mod crossing;
mod integers;

pub use crossing::{Crossing, Line};
