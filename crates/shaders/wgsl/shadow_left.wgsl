//! use params ieee divide exact units ray {intersector.left} {layout.nodes} any to_light way shade is_blocked
// The shadows of the hits that `trace_and_shadow_camera` left open, now that they are settled.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn shadow_left(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let open = atomicLoad(&counts[OPEN_RAYS]);
    for (var k = element(id, groups, 64u); k < open; k += 64u * groups.x * groups.y) {
        let i = blocked[params.first + k];
        let hit = hits[i];
        forget_notes();
        var dark = false;
        if hit.w != 0xffffffffu { dark = is_blocked(hit, scaled_point(bitcast<vec3<u32>>(params.eye))); }
        keep_any(i, dark, 3u);
    }
}
