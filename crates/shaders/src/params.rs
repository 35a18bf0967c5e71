//! The host's twin of `wgsl/shared/params.wgsl`; a test compares the two by reflection.

use bytemuck::{Pod, Zeroable};

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
    pub ray_count: u32,
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
