//! use params
// Positions as a driver's tree takes them: what is not finite becomes a vertex that switches its triangles off.

@group(0) @binding(1) var<storage, read> positions: array<u32>;
@group(0) @binding(2) var<storage, read_write> cleansed: array<u32>;

@compute @workgroup_size(128)
fn cleanse(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let vertex = element(id, groups, 128u);
    if vertex >= params.count { return; }
    let at = 3u * vertex;
    let v = vec3<u32>(positions[at], positions[at + 1u], positions[at + 2u]);
    let finite = all((v & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
    cleansed[at] = select(0x7fc00000u, v.x, finite);
    cleansed[at + 1u] = select(0x7fc00000u, v.y, finite);
    cleansed[at + 2u] = select(0x7fc00000u, v.z, finite);
}
