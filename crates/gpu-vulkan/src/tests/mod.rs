//! The whole backend on the device of this machine, with a view of its inside.
//!
//! Where there is no device, nothing is tested, unless `ABVH_REQUIRE_BACKENDS`
//! names `vulkan`. The validation layer listens where it is installed.

mod frames;
mod geometry;
mod limits;
mod roads;
mod scenes;
