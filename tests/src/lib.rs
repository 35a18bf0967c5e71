//! What the tests in `tests/` share: scenes, a stage to trace on, rays, and the program itself.
//!
//! Nothing here is part of the product.

pub mod fuzz;
pub mod program;
pub mod rays;
pub mod scenes;
pub mod stage;
