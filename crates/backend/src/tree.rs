//! Whether a tree is one of a scene: asked by every backend when it adopts one.

use crate::{BackendError, Result};
use bvh_layout::Topology;
use geom::Animation;

/// Refuses a tree that does not hold exactly the animation's live triangles.
///
/// A record names each triangle at most once, and none beyond its scene's, so
/// counting leaves and asking each whether it is live suffices.
///
/// # Errors
/// [`BackendError::WrongTree`] with what was found and expected.
pub fn check_tree(tree: &Topology, animation: &Animation) -> Result<()> {
    let counts = [
        (
            "triangles",
            tree.triangle_count(),
            animation.triangle_count(),
        ),
        ("leaves", tree.leaf_count(), animation.live_count()),
    ];
    for (what, found, expected) in counts {
        if found != expected {
            let why = format!("it has {found} {what}, the scene {expected}");
            return Err(BackendError::WrongTree(why));
        }
    }
    if let Some(moving) = tree.moving() {
        let (found, expected) = (moving.leaves().len(), animation.moving_count());
        if found != expected {
            let why = format!("its lists have {found} moving leaves, the scene {expected}");
            return Err(BackendError::WrongTree(why));
        }
    }
    if animation.live_count() == animation.triangle_count() {
        return Ok(());
    }
    match tree
        .leaf_triangles()
        .iter()
        .find(|&&t| !animation.is_live(t))
    {
        None => Ok(()),
        Some(t) => Err(BackendError::WrongTree(format!(
            "triangle {t} has a leaf but is never active"
        ))),
    }
}
