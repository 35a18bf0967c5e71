//! Types that most crates share: boxes, rays, hits, poses, cameras, animations, exact predicates, thread pools.
//!
//! The rounding of its formulas is specified, so that every backend reproduces them bit for bit. Contains no code for
//! trees, devices or files.

mod aabb;
mod animation;
mod camera;
pub mod exact;
mod key_frame;
mod key_frames;
mod key_window;
mod moment;
mod pose;
mod range;
mod ray;
mod sizes;
mod streamed_keys;
mod survey;
mod threads;
mod triangle;

pub use aabb::Aabb;
pub use animation::Animation;
pub use camera::{Camera, CameraPose};
pub use key_frame::{KeyFrame, KeyFrameError, KeySource, PointBuffer, SharedMemory, read_key};
pub use moment::Moment;
pub use pose::Pose;
pub use range::CoordinateRange;
pub use ray::{Hit, Ray};
pub use survey::StaticParts;
pub use threads::{
    convert_in_parallel, copy_in_parallel, for_each_in_parallel, in_parallel, lock, parallelism,
    run_in, set_each, start_library_pool, use_global_pool,
};
pub use triangle::{Triangle, is_active, is_degenerate, normal_signs, side_of};

/// A point or a vector: x, y, z.
pub type Point = [f32; 3];
