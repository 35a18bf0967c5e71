//! use params loops ieee divide exact units ray {intersector.settle} first settle_closest camera seen
// The closest hits of pixels' rays that `trace_camera` left open: as many invocations as there may be share the list.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;

@compute @workgroup_size(64)
fn settle_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let open = begin_settling(local, number, OPEN_RAYS);
    var round = 0u;
    for (var first = RAYS * number; first < open; first += RAYS * groups.x * groups.y) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        var direction = vec3<f32>(0.0);
        if k < open {
            i = blocked[params.first + k];
            list = listed(hits[i].y);
            direction = through_pixel(vec2<u32>(i % params.width, i / params.width));
            set_line(bitcast<vec3<u32>>(params.eye), bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, 0);
        }
        let leaf = first_of_notes(list, local);
        round += 1u;
        let whole = all_loops_turn(local, round);
        if whole && k < open && local % 16u == 0u { settle_closest(i, camera_ray(direction, scaled_point(bitcast<vec3<u32>>(params.eye))), leaf); }
    }
}
