//! One file a rival.

mod bvh;
#[cfg(feature = "embree")]
mod embree;
mod obvhs;
mod parry;

pub use self::bvh::Bvh;
#[cfg(feature = "embree")]
pub use self::embree::{EmbreeScene, Made, Packet16};
pub use self::obvhs::Obvhs;
pub use self::parry::Parry;
