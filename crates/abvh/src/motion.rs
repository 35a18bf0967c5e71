//! Motion of meshes.

use crate::Point;
use geom::Animation;
use std::sync::Arc;

/// Three rows of an affine map. On axis `i`, it maps a vertex `v` to
/// `m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2] + m[i][3]`, added from left to right, each operation rounded once.
pub type Matrix = [[f32; 4]; 3];

/// Motion of a mesh.
#[derive(Clone, Debug)]
pub(crate) enum MeshMotion {
    /// One or more key frames. With one, the mesh is fixed.
    Keys(Vec<Vec<Point>>),
    /// An animation with its own triangles, whose key frames may be read while they are played.
    Animated(Arc<Animation>),
    Streamed(Vec<Point>),
    Rigid {
        rest: Vec<Point>,
        part_of_vertex: Vec<u32>,
        parts: usize,
    },
}

impl MeshMotion {
    /// Returns the initial positions.
    pub(crate) fn first(&self) -> &[Point] {
        match self {
            Self::Keys(keys) => &keys[0],
            Self::Animated(animation) => animation.first(),
            Self::Streamed(rest) | Self::Rigid { rest, .. } => rest,
        }
    }

    /// Returns the number of key frames that [`Self::key`] can return. An animation provides only its first.
    pub(crate) fn key_count(&self) -> usize {
        match self {
            Self::Keys(keys) => keys.len(),
            _ => 1,
        }
    }

    /// Returns key frame `key`, or the last one if there are fewer.
    pub(crate) fn key(&self, key: usize) -> &[Point] {
        match self {
            Self::Keys(keys) => &keys[key.min(keys.len() - 1)],
            _ => self.first(),
        }
    }

    pub(crate) fn is_fixed(&self) -> bool {
        match self {
            Self::Keys(keys) => keys.len() == 1,
            Self::Animated(animation) => animation.key_count() == 1,
            Self::Streamed(_) | Self::Rigid { .. } => false,
        }
    }

    /// Returns whether steps pass its vertices or matrices.
    pub(crate) fn is_moved_by_steps(&self) -> bool {
        matches!(self, Self::Streamed(_) | Self::Rigid { .. })
    }
}

pub(crate) fn transform(m: &Matrix, v: Point) -> Point {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3])
}
