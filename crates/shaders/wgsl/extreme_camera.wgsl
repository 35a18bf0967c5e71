//! use params ieee rest divide exact soft units range direction whole point points line rounded coarse {layout.nodes} extreme camera
// The closest hits of the rays of a camera, all of which are extreme.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> triangles: array<u32>;
@group(0) @binding(6) var<storage, read> positions: array<u32>;

@compute @workgroup_size(64)
fn extreme_camera(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 64u);
    if i >= params.count { return; }
    hits[i] = MISS;
    let direction = bitcast<vec3<u32>>(through_pixel(vec2<u32>(i % params.width, i / params.width)));
    let is_void = all((direction & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u));
    if is_void || !is_finite_point(bitcast<vec3<f32>>(direction)) || !is_finite_point(params.eye) { return; }
    set_line(bitcast<vec3<u32>>(params.eye), direction, 0u, 0x7f800000u, 0);
    hits[i] = closest_extreme();
}
