//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.closest} {intersector.any} {layout.nodes} slab_ahead closest pixels camera eye seen any_singly any from_triangle to_light {intersector.way} shade is_occluded
// The closest hit of each pixel's ray, made here, and its shadow. Both in one go, which takes three quarters of the time
// that two kernels took on some scenes: warps that are done with the one go on to the other.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(128)
fn trace_and_shadow_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let i = pixel.y * params.width + pixel.x;
    let direction = through_pixel(pixel);
    let origin = eye();
    let root = root_from(origin);
    if misses_root(direction, origin, root) {
        hits[i] = MISS;
        store_occluded(i, false, 3u);
        return;
    }
    let ray = camera_ray(direction, origin, root);
    let found = find_closest(ray);
    let hit = hit_of(i, ray, found);
    hits[i] = hit;
    if is_unresolved(hit) {
        // Its notes, for `resolve_exact_together`.
        occluded[i] = hit.y;
        return;
    }
    var dark = false;
    if hit.w != 0xffffffffu { dark = is_occluded(way_from(found, hit, origin), hit.w); }
    store_occluded(i, dark, 3u);
}
