//! use params ieee divide exact units ray {intersector.settle} settle_closest {layout.nodes} closest camera seen
// The closest hits of pixels' rays that `trace_camera` left open: as many invocations as there may be share the list.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read> blocked: array<u32>;

@compute @workgroup_size(64)
fn settle_camera(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let open = atomicLoad(&counts[7]);
    let eye = bitcast<vec3<u32>>(params.eye);
    for (var k = element(id, groups, 64u); k < open; k += groups.x * groups.y * 64u) {
        let i = blocked[params.first + k];
        let direction = through_pixel(vec2<u32>(i % params.width, i / params.width));
        set_line(eye, bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, 0);
        settle_closest(i, camera_ray(direction, scaled_point(eye)));
    }
}
