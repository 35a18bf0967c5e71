//! use params ieee divide exact units ray {intersector.settle} settle_any {layout.nodes} any to_light shade
// The shadows that `shadow_camera` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn settle_shadow_camera(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let open = atomicLoad(&counts[8]);
    for (var k = element(id, groups, 64u); k < open; k += groups.x * groups.y * 64u) {
        let i = blocked[params.first + k];
        let hit = hits[i];
        let way = way_to_light(hit, scaled_point(bitcast<vec3<u32>>(params.eye)));
        // The way is in scaled units, and the corners are not.
        set_line(bitcast<vec3<u32>>(way.origin), bitcast<vec3<u32>>(way.direction), 0u, 0x3f800000u, params.scale_exponent);
        settle_any(i, ray_to_light(way), hit.w, 3u);
    }
}
