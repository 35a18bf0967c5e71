//! Guides, one topic per page.
//!
//! - [`concepts`]: scenes, steps, queries, hits, trees.
//! - [`streaming`]: meshes that a simulation moves, and how to overlap simulation and tracing.
//! - [`devices`]: device selection, and what to do if no GPU is found.
//! - [`accuracy`]: guarantees of each intersector, and the cases in which rays miss.
//! - [`migration`]: functions of Embree, `bvh` and `obvhs`, and their equivalents here.
//!
//! The examples of the package are complete programs: `stream_cloth`, `rigid_robot`, `lidar`, `picking`,
//! `wgpu_own_device`.

pub mod accuracy;
pub mod concepts;
pub mod devices;
pub mod migration;
pub mod streaming;
