//! When to ask for a tree and when to swap: a function of events, without a thread or a clock.

use backend::Generation;

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

/// What a frame has to do about trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FramePlan {
    /// Swap to this tree before anything else.
    pub(crate) swap: Option<Swap>,
    /// Ask for this tree, to be built from this frame's vertices.
    pub(crate) ask: Option<Generation>,
}

/// A swap at a frame boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Swap {
    /// The tree to take.
    pub(crate) generation: Generation,
    /// Whether it may still be under way, so that the driver has to wait for it.
    pub(crate) wait: bool,
}

/// Decides when to ask and when to swap. At most one build is in flight, and generations only rise.
#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    update: Update,
    newest: Generation,
    pending: Option<PendingBuild>,
}

#[derive(Clone, Copy, Debug)]
struct PendingBuild {
    generation: Generation,
    asked_at: u64,
    finished: bool,
}

impl Schedule {
    /// A schedule for a scene whose first tree has generation `first`.
    pub(crate) fn new(update: Update, first: Generation) -> Self {
        Self {
            update,
            newest: first,
            pending: None,
        }
    }

    /// The `frame`-th frame begins. `outdated` says whether the newest tree
    /// was built from other positions than this frame's.
    pub(crate) fn begin_frame(&mut self, frame: u64, outdated: bool) -> FramePlan {
        let swap = self.swap_due(frame);
        if swap.is_some() {
            self.pending = None;
        }
        // A tree swapped in just now was built for an earlier frame, unless nothing moved since.
        let ask = if outdated { self.ask(frame) } else { None };
        FramePlan { swap, ask }
    }

    /// The builder has finished `generation`.
    pub(crate) fn finished(&mut self, generation: Generation) {
        if let Some(pending) = self.pending.as_mut().filter(|f| f.generation == generation) {
            pending.finished = true;
        }
    }

    /// No swap of `generation` is due any more: its build came to nothing, and the tree in use stays, or it was
    /// swapped in at once, within the frame that requested it.
    pub(crate) fn forget(&mut self, generation: Generation) {
        self.pending.take_if(|f| f.generation == generation);
    }

    fn swap_due(&self, frame: u64) -> Option<Swap> {
        let pending = self.pending?;
        let (is_due, wait) = match self.update {
            Update::Async(Pace::Lockstep(k)) => {
                let due = pending.asked_at + u64::from(k);
                (frame >= due, !pending.finished)
            }
            _ => (pending.finished, false),
        };
        let generation = pending.generation;
        is_due.then_some(Swap { generation, wait })
    }

    fn ask(&mut self, frame: u64) -> Option<Generation> {
        let is_built = matches!(self.update, Update::Rebuild | Update::Async(_));
        if self.pending.is_some() || !is_built {
            return None;
        }
        self.newest = Generation(self.newest.0 + 1);
        let generation = self.newest;
        self.pending = Some(PendingBuild {
            generation,
            asked_at: frame,
            finished: false,
        });
        Some(generation)
    }

    /// Whether every new tree is swapped in before the frame that asked for it is traced.
    pub(crate) fn waits_at_once(&self) -> bool {
        matches!(
            self.update,
            Update::Rebuild | Update::Async(Pace::Lockstep(0))
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FIRST: Generation = Generation(1);

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        /// Whatever happens, in whatever order: one build at a time, generations rise, only finished trees are taken.
        #[test]
        fn generations_rise_and_flights_do_not_overlap(events in proptest::collection::vec(0_u8..4, 1..200)) {
            let mut s = Schedule::new(Update::Async(Pace::Free), FIRST);
            let (mut newest, mut flying, mut done, mut frame) = (FIRST, None, false, 0);
            for e in events {
                match (e, flying) {
                    (0, Some(g)) => { s.finished(g); done = true; }
                    (1, Some(g)) if !done => { s.forget(g); flying = None; }
                    _ => {
                        let plan = s.begin_frame(frame, e != 2);
                        frame += 1;
                        if let Some(swap) = plan.swap {
                            prop_assert!(done && flying == Some(swap.generation) && !swap.wait);
                            (flying, done) = (None, false);
                        }
                        if let Some(g) = plan.ask {
                            prop_assert!(flying.is_none() && g > newest);
                            (newest, flying) = (g, Some(g));
                        }
                    }
                }
            }
        }
    }
}
