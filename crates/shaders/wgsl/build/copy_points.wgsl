// Copies words between two buffers. The words are positions of the calling program, which become a key frame. Or they
// are results of any-hit queries with `exact`, which a buffer of the calling program receives.

import package::lib::params::{element_index, params};

@group(0) @binding(next) var<storage, read> copy_source: array<u32>;
@group(0) @binding(next) var<storage, read_write> key_frame: array<u32>;

// Parameters: points.
@compute @workgroup_size(128)
fn copy_points(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i < params.count { key_frame[params.points.target_at + i] = copy_source[params.points.source_at + i]; }
}
