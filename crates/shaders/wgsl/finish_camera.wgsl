//! use params ieee divide exact units ray {intersector.finish} first {layout.nodes} walk finish_closest camera seen
// The closest hits of pixels' rays that `settle_camera` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;

@compute @workgroup_size(64)
fn finish_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let place = 4u * (group.x + group.y * groups.x) + local / 16u;
    if !has_place(local, place, OPEN_RAYS) { return; }
    loop {
        let i = ray_at(place, OPEN_RAYS);
        if i == NO_RAY { break; }
        let direction = through_pixel(vec2<u32>(i % params.width, i / params.width));
        set_line(bitcast<vec3<u32>>(params.eye), bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, 0);
        if !finish_closest(place, i, camera_ray(direction, scaled_point(bitcast<vec3<u32>>(params.eye)))) { break; }
        leave(place);
    }
}
