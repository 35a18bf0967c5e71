//! Hits to pixels, measured points to charts; arrays, pictures and rows to whole files.
//!
//! Every file is written beside its final name and renamed when it is whole, so
//! that nobody ever reads half a file. What a file holds depends on what it is
//! given and on nothing else (no clock, no thread count), so that equal results
//! are equal bytes.

mod atomic;
mod digest;
mod hits;
pub mod plot;
mod rays;
mod shading;
mod stats;
mod timeline;

pub use atomic::{
    UnfinishedFile, WriteError, check_dir, check_writable, prepare_dir, remove_link,
    remove_unfinished, write_whole, write_with,
};
pub use digest::{Digest, digest_of};
pub use hits::{HitArrays, write_found, write_hits};
pub use rays::{RaysError, read_rays, write_rays};
pub use shading::{Shot, View, drop_alpha, frame_scene, palette, shade, write_png};
pub use stats::{
    Course, FrameStats, Overview, SCHEMA, SceneFacts, Stats, Summary, TIMES, Taken, Time, overview,
    rounded, write_json,
};
pub use timeline::{Timeline, Track, write_timeline};
