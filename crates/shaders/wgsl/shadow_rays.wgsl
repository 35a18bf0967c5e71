//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.any} {layout.nodes} slab_ahead any_singly any from_triangle to_light shade is_occluded
// The shadow of each given ray's hit.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@group(0) @binding(8) var<storage, read> rays: array<vec4<u32>>;

@compute @workgroup_size(128)
fn shadow_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    let hit = hits[i];
    var dark = false;
    if hit.w != 0xffffffffu { dark = is_occluded(to_light(hit, scaled_point(rays[2u * i].xyz)), hit.w); }
    store_occluded(i, dark, 3u);
}
