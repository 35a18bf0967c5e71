//! What is sent beside the frames.

/// What goes to the device beside the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// A tree's record.
    Tree,
    /// The positions of a key frame.
    KeyFrame,
}

impl Sent {
    /// Its name in messages.
    pub fn what(self) -> &'static str {
        match self {
            Self::Tree => "the tree's record",
            Self::KeyFrame => "key frames",
        }
    }

    /// Bytes from which on few are kept at a time, for their memory counts more than a wait.
    pub const LARGE: u64 = 64 << 20;

    /// Bytes to make room for, so that the next one fits too: trees of one scene differ little, key frames not at all.
    pub fn room(self, bytes: u64) -> u64 {
        match self {
            Self::Tree => bytes + bytes / 32,
            Self::KeyFrame => bytes,
        }
    }
}
