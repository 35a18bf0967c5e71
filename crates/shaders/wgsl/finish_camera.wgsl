//! use params loops ieee divide exact units ray {intersector.finish} first {layout.nodes} walk finish_closest camera seen
// The closest hits of pixels' rays that `settle_camera` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;

fn finish_ray(place: u32, i: u32) -> bool {
    let direction = through_pixel(vec2<u32>(i % params.width, i / params.width));
    set_line(bitcast<vec3<u32>>(params.eye), bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, 0);
    return finish_closest(place, i, camera_ray(direction, scaled_point(bitcast<vec3<u32>>(params.eye))));
}

@compute @workgroup_size(64)
fn finish_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    finish_open(local, group.x + group.y * groups.x, OPEN_RAYS);
}
