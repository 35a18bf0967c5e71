//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.bind} {intersector.open} {intersector.closest} {layout.nodes} slab_anywhere closest given
// The closest hit of each given ray.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> rays: array<vec4<u32>>;

@compute @workgroup_size(128)
fn trace_rays(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element(id, groups, 128u);
    if i >= params.count { return; }
    if is_void(i) {
        hits[i] = MISS;
        return;
    }
    let ray = given_ray(i);
    hits[i] = hit_of(i, ray, find_closest(ray));
}
