//! When to ask for a tree and when to swap: a function of events, without a thread or a clock.

/// How trees follow the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// A new tree from each frame's own vertices before it is traced.
    Rebuild,
    /// The first tree, refitted.
    Refit,
    /// The newest finished tree, refitted, while the next one is built.
    Async(Pace),
    /// One tree built for the whole time that is rendered, refitted.
    TSah,
    /// A new tree made on the device in each frame, from its own vertices.
    DeviceRebuild,
}

impl Update {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rebuild => "rebuild",
            Self::Refit => "refit",
            Self::Async(_) => "async",
            Self::TSah => "t-sah",
            Self::DeviceRebuild => "device-rebuild",
        }
    }

    /// Whether the host builds trees after the first.
    pub(crate) fn asks_for_trees(self) -> bool {
        matches!(self, Self::Rebuild | Self::Async(_))
    }

    /// Whether every new tree is swapped in before the frame that asked for it is traced.
    pub(crate) fn waits_at_once(self) -> bool {
        matches!(self, Self::Rebuild | Self::Async(Pace::Lockstep(0)))
    }

    /// Whether a frame swaps to a tree that was asked for so many frames ago, finished or not.
    pub(crate) fn swaps_after(self, frames: u64, finished: bool) -> bool {
        match self {
            Self::Async(Pace::Lockstep(k)) => frames >= u64::from(k),
            _ => finished,
        }
    }
}

/// When a tree that was asked for is swapped in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// At the first frame boundary after it is finished.
    Free,
    /// Exactly this many frames after it was asked for; the driver waits if it must.
    /// With 0 each frame waits for its own tree, as with [`Update::Rebuild`].
    Lockstep(u32),
}
