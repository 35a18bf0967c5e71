//! Decides when trees are requested and adopted: a pure function, without threads or clocks.

use backend::Policy;

/// A build in flight, as seen by the schedule.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InFlight {
    /// Number of the frame that requested it.
    pub(crate) requested_at: u64,
    /// Whether the tree was accepted or rejected. The next frame boundary adopts or drops it.
    pub(crate) is_decided: bool,
}

/// Steps of a frame that concern trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FramePlan {
    /// Adopt the tree in flight, or drop it if it was rejected, before any other step.
    pub(crate) swap: bool,
    /// The tree may be unfinished, so the driver must wait for it.
    pub(crate) wait: bool,
    /// Request a tree for this frame.
    pub(crate) request: bool,
}

/// Returns the steps of frame `frame` that concern trees. At most one build is in flight. `outdated` is set if the
/// newest tree was built for another pose than the frame would request, and a request is allowed.
pub(crate) fn plan(
    policy: Policy,
    frame: u64,
    build: Option<InFlight>,
    outdated: bool,
) -> FramePlan {
    let is_decided = build.is_some_and(|build| build.is_decided);
    let swap = match policy.lockstep() {
        Some(k) => build.is_some_and(|build| frame >= build.requested_at + u64::from(k)),
        None => is_decided,
    };
    FramePlan {
        swap,
        wait: swap && !is_decided,
        // A tree that is adopted now was built for an earlier frame. It is outdated unless nothing has moved since.
        request: policy.requests_trees() && outdated && (swap || build.is_none()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Policy = Policy::Async;
    const LOCKSTEP: Policy = Policy::Lockstep(3);

    /// Returns the plan of a frame whose newest tree is outdated, as letters: swap, wait, request. A build was
    /// requested in frame 5.
    fn letters(policy: Policy, frame: u64, is_decided: Option<bool>) -> String {
        let build = is_decided.map(|is_decided| InFlight {
            requested_at: 5,
            is_decided,
        });
        let [found, current] = [true, false].map(|outdated| plan(policy, frame, build, outdated));
        assert_eq!(
            current,
            FramePlan {
                request: false,
                ..found
            }
        );
        let letters = [(found.swap, 's'), (found.wait, 'w'), (found.request, 'r')];
        letters.iter().filter(|l| l.0).map(|l| l.1).collect()
    }

    #[test]
    fn schedules_one_build_at_a_time() {
        for (policy, frame, [none, in_flight, adoptable]) in [
            (FREE, 6, ["r", "", "sr"]),
            (FREE, 99, ["r", "", "sr"]),
            (LOCKSTEP, 7, ["r", "", ""]),
            (LOCKSTEP, 8, ["r", "swr", "sr"]),
            (LOCKSTEP, 9, ["r", "swr", "sr"]),
            (Policy::Rebuild, 6, ["r", "", "sr"]),
            (Policy::Refit, 6, ["", "", "s"]),
            (Policy::DeviceRebuild, 6, ["", "", "s"]),
        ] {
            let found =
                [None, Some(false), Some(true)].map(|adoptable| letters(policy, frame, adoptable));
            assert_eq!(found, [none, in_flight, adoptable], "{policy:?} {frame}");
        }
    }
}
