//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.bind} {intersector.any} {layout.nodes} slab_anywhere any_singly any given
// Whether each given ray meets anything.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;

@compute @workgroup_size(128)
fn any_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    var met = false;
    if !is_void(i) { met = ask_any(given_ray(i), 0xffffffffu); }
    store_occluded(i, met, 2u);
}
