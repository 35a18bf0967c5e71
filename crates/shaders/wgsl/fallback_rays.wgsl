//! use params ieee rest divide exact units range root direction ray {intersector.finish} first {layout.nodes} walk fallback_closest given line_of
// The closest hits of given rays that `resolve_exact_rays` left open.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(8) var<storage, read_write> occluded: array<u32>;

fn fallback_ray(place: u32, i: u32) {
    set_line_of(i);
    fallback_closest(place, i, ray_of(i));
}

@compute @workgroup_size(64)
fn fallback_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    fallback_open(local, group.x + group.y * groups.x, OPEN_RAYS);
}
