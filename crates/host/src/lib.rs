//! What the host lends: regular files, and memory that is there before it is allocated.

mod file;
mod memory;

pub use file::{File, Folder, open, read};
pub use memory::{Free, NotEnough, check, free, room, within};
