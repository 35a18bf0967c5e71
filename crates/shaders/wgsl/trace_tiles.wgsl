//! use params loops ieee rest divide exact units root ray {intersector.test} {intersector.closest} {intersector.any} {treelets.adopt} {layout.nodes} stretch_ahead camera eye seen any from_triangle {intersector.way} shade is_blocked {intersector.tiles} lanes_group cover tile
// Closest hits of a camera's rays and their shadows, tile by tile: a workgroup each.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> covers: array<vec4<u32>>;

@compute @workgroup_size(32)
fn trace_tiles(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(group.xy, lane);
}
