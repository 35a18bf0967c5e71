//! Input and options of a build.

use super::Vertices;
use backend::{Snapshot, TreeWriter};
use geom::{KeyFrame, Point, Pose};

/// Vertices and options of a build. See [`TreeBuilder::build`](super::TreeBuilder::build).
pub(crate) struct BuildInput {
    /// Source of the vertices.
    pub(crate) vertices: Vertices,
    /// Poses at one quarter and at three quarters of the tree's expected use. If set, the tree is built over boxes that
    /// contain each triangle at both. Ignored for a compared tree unless trees degrade fast.
    pub(crate) swept_poses: Option<[Pose; 2]>,
    /// Positions that all poses refer to, if they do not refer to key frames.
    pub(crate) observed: Option<Observed>,
    /// The two key frames that all poses refer to, if the animation may drop them before the build.
    pub(crate) key_frames: Option<[KeyFrame; 2]>,
    /// Whether the tree is compared with the last one, because it is adopted only if it costs less.
    pub(crate) is_compared: bool,
    /// Common end point of the any-hit rays, if they have one. The tree is ordered for these rays: see
    /// [`SahBuilder::toward`](bvh_build::SahBuilder::toward).
    pub(crate) toward: Option<Point>,
    /// Writes the tree in the device's format, if the backend provides a writer.
    pub(crate) writer: Option<TreeWriter>,
}

impl BuildInput {
    /// Creates the input of a tree that is built from these vertices alone and compared with no other tree.
    pub(crate) fn of(vertices: Vertices) -> Self {
        Self {
            vertices,
            swept_poses: None,
            observed: None,
            key_frames: None,
            is_compared: false,
            toward: None,
            writer: None,
        }
    }
}

/// Positions of two frames that were read back, and the times of these frames.
pub(crate) struct Observed {
    pub(crate) frames: [Snapshot; 2],
    pub(crate) times: [f64; 2],
}
