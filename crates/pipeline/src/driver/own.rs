//! Frames whose trees the backend makes, on its own account or because the policy says so: nobody builds beside them.

use super::trees::{FIRST, Tree};
use super::{Driver, PipelineError};
use crate::schedule::Update;
use backend::{Backend, BackendError, Generation};
use geom::Pose;

/// Refuses what has no meaning for a backend that makes all its trees itself.
pub(super) fn admit(backend: &dyn Backend, update: Update) -> Result<(), BackendError> {
    let policy = match update {
        _ if !backend.makes_own_trees() => return Ok(()),
        Update::Rebuild | Update::Refit | Update::DeviceRebuild => return Ok(()),
        Update::Async(_) => "async",
        Update::TSah => "t-sah",
    };
    Err(BackendError::Unsupported {
        backend: backend.device().backend,
        what: format!(
            "update policy '{policy}': it makes its trees itself, within each frame, and takes none that \
             others built; rebuild and refit it does"
        ),
    })
}

impl Driver {
    /// Whether the backend makes the trees.
    pub(super) fn makes_trees(&self) -> bool {
        let asked = self.options.update == Update::DeviceRebuild;
        asked || self.backend.makes_own_trees()
    }

    /// Records positions at `pose` and, in the first frame and wherever all are to be rebuilt, a
    /// tree of them; says whether a refit must follow.
    pub(super) fn record_own_tree(&mut self, pose: Pose) -> Result<bool, PipelineError> {
        let moved = self.record_geometry(pose)?;
        let anew = matches!(self.options.update, Update::Rebuild | Update::DeviceRebuild);
        let generation = match &self.tree {
            None => FIRST,
            Some(tree) if moved && anew => Generation(tree.generation.0 + 1),
            Some(_) => return Ok(moved),
        };
        self.backend.rebuild(generation)?;
        self.record.made = true;
        self.tree = Some(Tree {
            generation,
            frame: self.frames,
            pose,
            middle: f64::NAN,
            cost: 0.0,
        });
        Ok(true)
    }
}
