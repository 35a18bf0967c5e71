//! use params ieee rest divide exact units range root direction ray {intersector.settle} resolve_exact_any given line_of share_any
// Whether given rays that `any_rays` left open meet anything.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

fn set_line_asked(i: u32) { set_line_of(i); }

@compute @workgroup_size(64)
fn resolve_exact_any_rays(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    resolve_exact_queries(local, number, groups.x * groups.y, 2u);
}
