//! use params ieee divide exact units ray {intersector.test} {intersector.any} {layout.nodes} any to_light way shade is_blocked pixels
// The shadow of each pixel's hit.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

@compute @workgroup_size(128)
fn shadow_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let pixel = pixel_of(local, group);
    if pixel.x >= params.width || pixel.y >= params.height { return; }
    let i = pixel.y * params.width + pixel.x;
    let hit = hits[i];
    var dark = false;
    if hit.w != 0xffffffffu { dark = is_blocked(hit, scaled_point(bitcast<vec3<u32>>(params.eye))); }
    keep_any(i, dark, 3u);
}
