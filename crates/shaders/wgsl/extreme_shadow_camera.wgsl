//! use params ieee rest divide exact soft units range direction whole point points line rounded coarse {layout.nodes} extreme extreme_shadow camera
// The shadows of the hits of a camera's rays, all of which are extreme.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn extreme_shadow_camera(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 64u);
    if i >= params.count { return; }
    occluded[i] = 0u;
    if hits[i].w == NO_TRIANGLE { return; }
    let direction = bitcast<vec3<u32>>(through_pixel(vec2<u32>(i % params.width, i / params.width)));
    if is_in_extreme_shadow(bitcast<vec3<u32>>(params.eye), direction, hits[i]) {
        occluded[i] = 1u;
        atomicAdd(&counts[3], 1u);
    }
}
