//! use params ieee rest divide exact units range root direction ray {intersector.test} {intersector.bind} {intersector.open} {intersector.closest} {layout.nodes} slab_ahead closest pixels camera eye seen
// The closest hit of each pixel's ray, made here.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(128)
fn trace_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let direction = through_pixel(pixel);
    let i = pixel.y * params.width + pixel.x;
    let origin = eye();
    let root = root_from(origin);
    if misses_root(direction, origin, root) {
        hits[i] = MISS;
        return;
    }
    let ray = camera_ray(direction, origin, root);
    hits[i] = hit_of(i, ray, find_closest(ray));
}
