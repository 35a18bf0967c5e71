//! use params ieee rest divide exact units range root direction ray {intersector.finish} {layout.nodes} walk fallback_any eye from_triangle to_light shade line_to_light
// The shadows that `resolve_exact_shadow_camera` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

fn fallback_ray(place: u32, i: u32) {
    let way = to_light(hits[i], eye());
    set_line_along(way);
    fallback_any(place, i, ray_to_light(way), hits[i].w, 3u);
}

@compute @workgroup_size(64)
fn fallback_shadow_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    fallback_open(local, group.x + group.y * groups.x, OPEN_SHADOWS);
}
