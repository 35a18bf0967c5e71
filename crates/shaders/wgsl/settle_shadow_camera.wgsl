//! use params loops ieee divide exact units ray {intersector.settle} settle_any to_light way shade line_to_light
// The shadows that `trace_and_shadow_camera` and `shadow_left` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn settle_shadow_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let open = begin_settling(local, number, OPEN_SHADOWS);
    var round = 0u;
    for (var first = RAYS * number; first < open; first += RAYS * groups.x * groups.y) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = blocked[params.destination + k];
            list = listed(blocked[i]);
            let way = way_to_light(hits[i], scaled_point(bitcast<vec3<u32>>(params.eye)));
            set_line_along(way);
        }
        let said = said_by_notes(list, local);
        round += 1u;
        let whole = all_loops_turn(local, round);
        if whole && k < open && local % 16u == 0u { settle_any(i, 3u, said); }
    }
}
