//! Transforms of nodes and of mesh instances.

use glam::{DMat4, DQuat, DVec3};

/// Scale, then rotation, then translation.
#[derive(Clone, Copy)]
pub(super) struct Transform {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

impl Transform {
    pub(super) fn of_matrix(matrix: &DMat4) -> Self {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        Self {
            translation,
            rotation,
            scale,
        }
    }

    pub(super) fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// Returns the rotation of a quaternion (x, y, z, w). A zero quaternion becomes the identity.
pub(super) fn unit(quaternion: &[f64]) -> DQuat {
    let q = DQuat::from_slice(quaternion);
    if q.length_squared() == 0.0 {
        DQuat::IDENTITY
    } else {
        q.normalize()
    }
}

pub(super) fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}
