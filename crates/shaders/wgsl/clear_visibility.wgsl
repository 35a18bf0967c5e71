//! use params
// Empties the visibility buffer, two words of 64 bits an invocation: see "Rasterization" in ARCHITECTURE.md.

@group(0) @binding(1) var<storage, read_write> visibility: array<vec4<u32>>;

@compute @workgroup_size(128)
fn clear_visibility(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i < params.count { visibility[i] = vec4<u32>(0xffffffffu); }
}
