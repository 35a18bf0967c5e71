//! One file a rival.

mod bvh;
mod obvhs;
mod parry;

pub use self::bvh::Bvh;
pub use self::obvhs::Obvhs;
pub use self::parry::Parry;
