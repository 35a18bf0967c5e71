//! Output files: arrays, pictures, videos, statistics, and charts of measurements.
//!
//! A file is written under a temporary name in its directory and renamed when it is complete, so readers never see a
//! partial file. After an error, a file with the final name is unchanged. Exceptions are journals, which are appended
//! to, and devices, pipes and open descriptors.
//!
//! The content depends only on the data, not on the clock or the thread count. So equal results produce equal bytes.
//! Exceptions are encoded videos and the order of a journal's lines.

mod atomic;
mod hits;
mod journal;
mod picture;
pub mod plot;
mod rays;
mod stats;
mod video;

pub use atomic::{
    OutputError, check_dir, check_writable, follow_links, prepare_dir, remove_special_file,
    remove_unfinished, write_whole, write_with,
};
pub use hits::{HitArrays, write_any_hits};
pub use journal::{
    Digest, FileKind, Journal, JournalContents, Manifest, NamedDigest, SceneId, clear_run, digests,
};
pub use picture::{drop_alpha, write_png};
pub use rays::{RayFile, write_rays};
pub use stats::{
    AutoChoice, FrameQuantity, SCHEMA, Summary, TIMES, memory_text, mrays, overview, trees_text,
    write_json,
};
pub use video::{Video, VideoFiles, VideoPlanes};
