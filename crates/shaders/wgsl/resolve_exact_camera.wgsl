//! use params ieee rest divide exact units range root direction ray {intersector.settle} first resolve_exact_closest camera eye seen pixel_line share_hits
// The closest hits of pixels' rays that `trace_camera` left open: as many invocations as there may be share the list.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;

@compute @workgroup_size(64)
fn resolve_exact_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_hits(local, number, groups.x * groups.y);
}
