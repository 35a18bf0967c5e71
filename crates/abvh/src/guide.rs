//! Guides, one topic a page.
//!
//! - [`concepts`]: scenes, steps, queries, hits, trees.
//! - [`streaming`]: meshes that a simulation moves, and how its work overlaps with tracing.
//! - [`devices`]: which device is taken, how to name one, what to do where none is found.
//! - [`accuracy`]: what an intersector promises, and what makes a ray miss.
//! - [`migration`]: the calls of Embree, `bvh` and `obvhs`, and what stands for them here.
//!
//! The examples of the package are whole programs: `hello_rays`, `stream_cloth`, `rigid_robot`, `lidar`, `many_cameras`,
//! `picking`, `picture`, `wgpu_own_device`.

pub mod accuracy;
pub mod concepts;
pub mod devices;
pub mod migration;
pub mod streaming;
