//! Decides when trees are requested and swapped in: a pure function, without threads or clocks.

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

/// A build in flight, as seen by the schedule.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InFlight {
    /// Number of the frame that requested it.
    pub(crate) asked_at: u64,
    /// Whether its tree is finished and may be adopted.
    pub(crate) is_adoptable: bool,
}

/// Steps of a frame that concern trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FramePlan {
    /// Swap to the tree in flight before any other step.
    pub(crate) swap: bool,
    /// The tree may be unfinished, so the driver must wait for it.
    pub(crate) wait: bool,
    /// Request a tree for this frame.
    pub(crate) ask: bool,
}

impl Update {
    /// When to ask and when to swap: at most one build is in flight. `outdated` says whether the newest tree
    /// was built from other positions than this frame's.
    pub(crate) fn plan(self, frame: u64, build: Option<InFlight>, outdated: bool) -> FramePlan {
        let is_adoptable = build.is_some_and(|build| build.is_adoptable);
        let swap = match self {
            Self::Async(Pace::Lockstep(k)) => {
                build.is_some_and(|build| frame >= build.asked_at + u64::from(k))
            }
            _ => is_adoptable,
        };
        let is_built = matches!(self, Self::Rebuild | Self::Async(_));
        FramePlan {
            swap,
            wait: swap && !is_adoptable,
            // A tree swapped in just now was built for an earlier frame, unless nothing moved since.
            ask: is_built && outdated && (swap || build.is_none()),
        }
    }

    /// Whether every new tree is swapped in before the frame that asked for it is traced.
    pub(crate) fn waits_at_once(self) -> bool {
        matches!(self, Self::Rebuild | Self::Async(Pace::Lockstep(0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Update = Update::Async(Pace::Free);
    const LOCKSTEP: Update = Update::Async(Pace::Lockstep(3));

    /// Returns the plan of a frame whose newest tree is outdated, as letters: swap, wait, ask. A build was requested in
    /// frame 5.
    fn plan(update: Update, frame: u64, is_adoptable: Option<bool>) -> String {
        let build = is_adoptable.map(|is_adoptable| InFlight {
            asked_at: 5,
            is_adoptable,
        });
        let plan = update.plan(frame, build, true);
        let current = update.plan(frame, build, false);
        assert_eq!(current, FramePlan { ask: false, ..plan });
        let letters = [(plan.swap, 's'), (plan.wait, 'w'), (plan.ask, 'a')];
        letters.iter().filter(|l| l.0).map(|l| l.1).collect()
    }

    #[test]
    fn one_build_is_in_flight_and_swapped_to_once_it_is_finished_or_due() {
        for (update, frame, [none, under_way, adoptable]) in [
            (FREE, 6, ["a", "", "sa"]),
            (FREE, 99, ["a", "", "sa"]),
            (LOCKSTEP, 7, ["a", "", ""]),
            (LOCKSTEP, 8, ["a", "swa", "sa"]),
            (LOCKSTEP, 9, ["a", "swa", "sa"]),
            (Update::Rebuild, 6, ["a", "", "sa"]),
            (Update::Refit, 6, ["", "", "s"]),
            (Update::TSah, 6, ["", "", "s"]),
            (Update::DeviceRebuild, 6, ["", "", "s"]),
        ] {
            let found =
                [None, Some(false), Some(true)].map(|adoptable| plan(update, frame, adoptable));
            assert_eq!(found, [none, under_way, adoptable], "{update:?} {frame}");
        }
    }
}
