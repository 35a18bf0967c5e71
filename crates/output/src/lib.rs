//! Measured points to charts; arrays, pictures, videos and rows to whole files.
//!
//! Every file is written beside its final name and renamed when it is whole, so that nobody ever reads half a file. After
//! an error the final name holds what it held before. What a file holds depends on what it is given and on nothing else
//! (no clock, no thread count), so that equal results are equal bytes.

mod atomic;
mod hits;
mod journal;
pub mod plot;
mod rays;
mod stats;
mod timeline;
mod video;

pub use atomic::{
    OutputError, check_dir, check_writable, prepare_dir, remove_special_file, remove_unfinished,
    write_whole, write_with,
};
pub use hits::{HitArrays, write_found};
pub use journal::{Digest, Finished, Journal, Manifest, NamedDigest, SceneId, clear_run, digests};
pub use rays::{RayFile, write_rays};
pub use stats::{
    FrameStats, SCHEMA, Summary, TIMES, Taken, Time, memory, mrays, overview, rates, trees,
    write_json,
};
pub use timeline::RunTimeline;
pub use video::{Chroma, Planes, Video, drop_alpha, write_png};
