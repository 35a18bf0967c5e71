//! use params ieee rest divide units degenerate flat point corner
// How many triangles are inactive and how many degenerate, which a driver does not tell.

@group(0) @binding(1) var<storage, read> triangles: array<u32>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(128)
fn count_triangles(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let triangle = element(id, groups, 128u);
    if triangle >= params.count { return; }
    let a = corner(triangle, 0u);
    let b = corner(triangle, 1u);
    let c = corner(triangle, 2u);
    if !(is_finite(a) && is_finite(b) && is_finite(c)) {
        atomicAdd(&counts[0], 1u);
    } else if is_flat(a, b, c, scaled_point(a), scaled_point(b), scaled_point(c)) {
        atomicAdd(&counts[1], 1u);
    }
}
