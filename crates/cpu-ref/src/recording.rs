//! What was recorded since the last submission, and what would be stale by now.

use backend::{Query, QueryKind, Rays};
use geom::{Camera, Pose};

/// One recorded stage.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Command {
    Interpolate(Pose),
    Preprocess,
    Refit,
    /// Traces a camera's rays, or those that come with the command.
    Trace(Option<Camera>, QueryKind),
    CopyPositions,
}

/// How far the tree follows the positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Fresh {
    #[default]
    Nothing,
    Records,
    Boxes,
}

/// Commands in order, and how far the state they lead to is in step.
#[derive(Debug, Default)]
pub(crate) struct Recording {
    /// Since the last submission.
    commands: Vec<Command>,
    /// How many of them were carried out.
    done: usize,
    has_tree: bool,
    has_positions: bool,
    fresh: Fresh,
}

impl Recording {
    /// Forgets everything: another scene is current.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    /// # Panics
    /// If work on the tree before was recorded and not submitted.
    pub(crate) fn assert_between_submissions(&self) {
        let on_the_tree =
            |c: &Command| !matches!(c, Command::Interpolate(_) | Command::CopyPositions);
        assert!(
            !self.commands.iter().any(on_the_tree),
            "a tree is adopted between submissions: submit what was recorded for the one before"
        );
    }

    /// Another tree is current.
    pub(crate) fn adopted(&mut self) {
        (self.has_tree, self.fresh) = (true, Fresh::Nothing);
    }

    pub(crate) fn interpolate(&mut self, pose: Pose) {
        (self.has_positions, self.fresh) = (true, Fresh::Nothing);
        self.commands.push(Command::Interpolate(pose));
    }

    pub(crate) fn preprocess(&mut self) {
        assert!(
            self.has_positions,
            "preprocess reads positions: interpolate comes first"
        );
        assert!(
            self.has_tree,
            "preprocess follows a tree's leaves: adopt comes first"
        );
        self.fresh = Fresh::Records;
        self.commands.push(Command::Preprocess);
    }

    pub(crate) fn refit(&mut self) {
        assert!(
            self.fresh >= Fresh::Records,
            "refit reads boxes of leaves: preprocess comes first"
        );
        self.fresh = Fresh::Boxes;
        self.commands.push(Command::Refit);
    }

    pub(crate) fn trace(&mut self, query: Query<'_>) {
        assert!(
            self.fresh == Fresh::Boxes,
            "the tree is stale: preprocess and refit come after adopt and interpolate, and before trace"
        );
        assert!(!self.has_trace(), "one submission holds at most one trace");
        let camera = match query.rays {
            Rays::Camera(camera) => Some(*camera),
            Rays::List(_) => None,
        };
        self.commands.push(Command::Trace(camera, query.kind));
    }

    pub(crate) fn copy_positions(&mut self) {
        assert!(
            self.has_positions,
            "there are no positions to copy: interpolate comes first"
        );
        self.commands.push(Command::CopyPositions);
    }

    /// What is still to be carried out, by the caller and now.
    pub(crate) fn take_new(&mut self) -> &[Command] {
        let from = std::mem::replace(&mut self.done, self.commands.len());
        &self.commands[from..]
    }

    /// Whether there was something, and all of it was carried out.
    pub(crate) fn is_done(&self) -> bool {
        self.done > 0 && self.done == self.commands.len()
    }

    /// All of it was submitted.
    pub(crate) fn clear(&mut self) {
        self.commands.clear();
        self.done = 0;
    }

    pub(crate) fn has_trace(&self) -> bool {
        let traces = |c: &Command| matches!(c, Command::Trace(..));
        self.commands.iter().any(traces)
    }
}
