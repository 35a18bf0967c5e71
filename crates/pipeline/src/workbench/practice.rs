//! Trees that nobody asked for, so that those to come find their memory.

use super::{Manner, Vertices, Workbench};
use bvh_build::{BuildError, Cancel};
use geom::{Animation, Pose};

/// So often the next tree is made in practice: once to find memory, once more to write to what conversion gives back.
const ROUNDS: usize = 2;

impl Workbench {
    /// Makes the next tree, if it will be one of groups, to no end but to find memory for it: in demo:shatter (1.6M
    /// triangles) the first such tree took 120 ms, the second 43, later ones 20. Nothing is handed over.
    ///
    /// # Errors
    /// [`BuildError::Cancelled`].
    pub fn practise(
        &mut self,
        animation: &Animation,
        pose: Pose,
        cancel: &Cancel,
    ) -> Result<(), BuildError> {
        let groups = self.fading.manner() == Manner::Groups && !self.forms.blocks;
        if !groups || !self.holds_all_of(animation) {
            return Ok(());
        }
        for _ in 0..ROUNDS {
            self.regroup_at(animation, Vertices::KeyFrames(pose), cancel)?;
            let record = self.convert(animation);
            self.reuse(record.into_spare());
        }
        Ok(())
    }
}
