//! The host's twins of `wgsl/shared/params.wgsl` and of the buffer `counts`; a test compares the former by reflection.

use crate::Shape;
use bytemuck::{Pod, Zeroable};
use geom::Camera;

/// What changes from one dispatch to the next. See the WGSL for the meaning of each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(
    missing_docs,
    reason = "each member is explained in wgsl/shared/params.wgsl"
)]
pub struct Params {
    pub eye: [f32; 3],
    pub width: u32,
    pub corner: [f32; 3],
    pub height: u32,
    pub across: [f32; 3],
    pub first_group: u32,
    pub down: [f32; 3],
    pub alpha: f32,
    pub light: [f32; 3],
    pub scale: f32,
    pub scale_exponent: i32,
    pub count: u32,
    pub first: u32,
    pub leaf_bits_at: u32,
    pub leaf_ranks_at: u32,
    pub leaf_triangles_at: u32,
    pub node_count: u32,
    pub zero: u32,
}

impl Params {
    /// What all dispatches share over a scene scaled by `2^-scale_exponent` (in -126..=126) and a tree of this shape.
    #[must_use]
    pub fn of(scale_exponent: i32, tree: &Shape) -> Self {
        Self {
            scale: f32::from_bits(((127 - scale_exponent) as u32) << 23),
            scale_exponent,
            leaf_bits_at: tree.leaf_bits_at,
            leaf_ranks_at: tree.leaf_ranks_at,
            leaf_triangles_at: tree.leaf_triangles_at,
            node_count: tree.node_count,
            ..Self::default()
        }
    }

    /// The same, seen through a camera.
    pub(crate) fn through(self, camera: &Camera) -> Self {
        Self {
            eye: camera.eye,
            corner: camera.corner,
            across: camera.across,
            down: camera.down,
            width: camera.width,
            height: camera.height,
            ..self
        }
    }
}

/// What the kernels of a submission count, as it lies in the buffer `counts`.
/// The buffer is cleared before the submission's first stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Counts {
    /// Leaves whose triangle is inactive, by `preprocess`.
    pub inactive: u32,
    /// Leaves whose triangle is active but of zero area, by `preprocess`.
    pub degenerate: u32,
    /// Rays that hit, by `trace_*` and `any_*`.
    pub hits: u32,
    /// Hits in shadow, by `shadow_*`.
    pub blocked: u32,
    /// Half areas of all nodes but the root, in scaled units, by `sum_costs`.
    pub areas: f32,
    /// The root's half area, in scaled units, by `sum_costs`.
    pub root_area: f32,
}

impl Counts {
    /// The tree's cost by the surface area heuristic (traversal 1, intersection
    /// 1): all nodes' areas over the root's. `None` if the root has no area.
    #[must_use]
    pub fn sah_cost(&self) -> Option<f64> {
        let (areas, root) = (f64::from(self.areas), f64::from(self.root_area));
        (root > 0.0).then(|| (areas + root) / root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_counts_the_root_and_needs_one() {
        let counts = |areas, root_area| Counts {
            areas,
            root_area,
            ..Counts::default()
        };
        assert_eq!(counts(6.0, 2.0).sah_cost(), Some(4.0));
        assert_eq!(counts(0.0, 2.0).sah_cost(), Some(1.0));
        assert_eq!(counts(0.0, 0.0).sah_cost(), None);
    }

    #[test]
    fn the_scale_is_a_power_of_two_for_every_exponent() {
        for k in -126..=126 {
            let scale = Params::of(k, &Shape::default()).scale;
            assert_eq!(f64::from(scale), (-f64::from(k)).exp2());
        }
    }
}
